#include "config/load.h"

#include <gtest/gtest.h>

#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

using std::chrono::milliseconds;

constexpr std::string_view kApplication = R"({
  // Everything that an application can say.
  "$schema": "https://fastcycle.dev/schema/application.schema.json",
  "name": "speed_demo",
  "library_path": ["lib", "/opt/lib", "lib"],
  "on_fault": "restart", "log_level": "warning", "status_period_ms": 250,
  "executors": [
    {"name": "control", "threads": 2, "cpus": [1, 2], "policy": "fifo", "priority": 80,
     "wait": "adaptive", "hand_over": true}
  ],
  "topics": {
    "planning/speed": {"latched": 1, "ages": false, "pool_max": 64, "keep": 3,
                       "multiple_publishers": true, "external": true},
    "/map": {}
  },
  "shared_params": {"width_m": 2},
  "components": [
    {"name": "limiter", "library": "speed_limiter", "class": "demo::SpeedLimiter",
     "namespace": "front", "executor": "control", "serve_period_ms": 0.5, "serve_phase_ms": 0.25,
     "simulated_cost_ms": 1.5,
     "params": {"limit_mps": 22.2}, "remap": {"goal": "mission/goal"}, "on_fault": "stop",
     "log_level": "debug",
     "subscribers": {"planning/speed": {"depth": 4, "overflow": "drop_newest"}},
     "publishers": {"control/speed": {"keep": 2}},
     "threads": {"device": {"cpus": [0, 3], "policy": "rr", "priority": 40}}},
    {"name": "planner", "library": "planner"}
  ]
})";

struct LoadTest : testing::Test {
  ApplicationDescription load_text(std::string_view text) {
    return load({.file = folder.write("app.json", text)}, problems);
  }

  TestFolder folder;
  Problems problems;
};

TEST_F(LoadTest, EveryKeyArrives) {
  const ApplicationDescription app = load_text(kApplication);

  EXPECT_EQ(text_of(problems), "");
  EXPECT_EQ(app.name, "speed_demo");
  EXPECT_EQ(app.file, folder / "app.json");
  EXPECT_EQ(app.library_path, (std::vector<std::filesystem::path>{folder / "lib", "/opt/lib"}));
  EXPECT_EQ(app.on_fault, OnFault::kRestart);
  EXPECT_EQ(app.log_level, LogLevel::kWarning);
  EXPECT_EQ(app.status_period, std::chrono::milliseconds(250));
  EXPECT_EQ(app.shared_params.to_text(), R"({"width_m":2})");
  ASSERT_EQ(app.executors.size(), 1U);
  EXPECT_EQ(app.executors[0].name, "control");
  EXPECT_EQ(app.executors[0].threads, 2);
  EXPECT_EQ(app.executors[0].cpus, (std::vector<int>{1, 2}));
  EXPECT_EQ(app.executors[0].policy, Policy::kFifo);
  EXPECT_EQ(app.executors[0].priority, 80);
  EXPECT_EQ(app.executors[0].wait, Wait::kAdaptive);
  EXPECT_TRUE(app.executors[0].hand_over);
  ASSERT_EQ(app.topics.size(), 2U);
  EXPECT_EQ(app.topics[0].latched, 1);
  EXPECT_FALSE(app.topics[0].ages);
  EXPECT_TRUE(app.topics[0].external);
  EXPECT_EQ(app.topics[0].pool_max, 64U);
  EXPECT_EQ(app.topics[0].keep, 3U);
  EXPECT_TRUE(app.topics[0].multiple_publishers);
  EXPECT_EQ(app.topics[1].name, "map");
}

TEST_F(LoadTest, EveryKeyOfAComponentArrives) {
  const ApplicationDescription app = load_text(kApplication);

  ASSERT_EQ(app.components.size(), 2U);
  const ComponentDescription& limiter = app.components[0];
  EXPECT_EQ(limiter.name, "front/limiter");
  EXPECT_EQ(limiter.name_space, "front");
  EXPECT_EQ(limiter.library, "speed_limiter");
  EXPECT_EQ(limiter.class_name, "demo::SpeedLimiter");
  EXPECT_EQ(limiter.executor, "control");
  EXPECT_EQ(limiter.serve_period, std::chrono::microseconds(500));
  EXPECT_EQ(limiter.simulated_cost, std::chrono::microseconds(1500));
  EXPECT_EQ(limiter.serve_phase, std::chrono::microseconds(250));
  EXPECT_EQ(limiter.params.to_text(), R"({"limit_mps":22.2})");
  EXPECT_EQ(limiter.on_fault, OnFault::kStop);
  EXPECT_EQ(limiter.log_level, LogLevel::kDebug);
  EXPECT_EQ(limiter.subscribers.at("planning/speed").depth, 4U);
  EXPECT_EQ(limiter.subscribers.at("planning/speed").overflow, Overflow::kDropNewest);
  EXPECT_EQ(limiter.publishers.at("control/speed").keep, 2U);
  EXPECT_EQ(limiter.threads.at("device").cpus, (std::vector<int>{0, 3}));
  EXPECT_EQ(limiter.threads.at("device").policy, Policy::kRr);
  EXPECT_EQ(limiter.threads.at("device").priority, 40);
}

TEST_F(LoadTest, WhatIsNotSaidHasItsDefault) {
  const ApplicationDescription app = load_text(kApplication);

  const ComponentDescription& planner = app.components[1];
  EXPECT_EQ(planner.executor, "");
  EXPECT_FALSE(planner.serve_period);
  EXPECT_TRUE(planner.params.is_object());
  EXPECT_EQ(planner.on_fault, OnFault::kRestart) << "the application's default";
  EXPECT_EQ(planner.log_level, std::nullopt);
  EXPECT_EQ(app.topics[1].latched, 0);
  EXPECT_TRUE(app.topics[1].ages);
  EXPECT_FALSE(app.topics[1].pool_max);
}

TEST_F(LoadTest, TopicsAreRemappedAndThenPlaced) {
  ComponentDescription component;
  component.name_space = "front";
  component.remap = {{"goal", "mission/goal"}, {"map", "/map"}};

  EXPECT_EQ(resolve_topic(component, "speed"), "front/speed");
  EXPECT_EQ(resolve_topic(component, "goal"), "front/mission/goal");
  EXPECT_EQ(resolve_topic(component, "map"), "map");
  EXPECT_EQ(resolve_topic(component, "/fastcycle/status"), "fastcycle/status");
  EXPECT_EQ(resolve_topic(ComponentDescription{}, "speed"), "speed");
}

TEST_F(LoadTest, PeriodsAreExactInNanoseconds) {
  const ApplicationDescription app = load_text(R"({"name": "demo", "components": [
      {"name": "a", "library": "a", "serve_period_ms": 33.333333},
      {"name": "b", "library": "a", "serve_period_ms": 0.001},
      {"name": "c", "library": "a", "serve_period_ms": 86400000}]})");

  EXPECT_EQ(app.components[0].serve_period->count(), 33'333'333);
  EXPECT_EQ(app.components[1].serve_period->count(), 1'000);
  EXPECT_EQ(app.components[2].serve_period, std::chrono::hours(24));
  EXPECT_FALSE(problems.has_errors());
}

TEST_F(LoadTest, ExecutorThatNoOneUsesIsAWarning) {
  (void)load_text(R"({"name": "demo", "executors": [{"name": "idle"}],
                      "components": [{"name": "a", "library": "a"}]})");

  EXPECT_FALSE(problems.has_errors());
  EXPECT_NE(text_of(problems).find("warning: no component uses the executor \"idle\""),
            std::string::npos);
}

TEST_F(LoadTest, SpinningOnCpusOfItsOwnIsAllowed) {
  (void)load_text(R"({"name": "demo", "executors": [
      {"name": "fast", "policy": "fifo", "priority": 80, "wait": "spin", "cpus": [1]},
      {"name": "slow", "cpus": [0]}], "components": [
      {"name": "a", "library": "a", "executor": "fast"},
      {"name": "b", "library": "a", "executor": "slow"}]})");

  EXPECT_EQ(text_of(problems), "");
}

TEST_F(LoadTest, PriorityOfAThreadNeedsAPolicyAndAPolicyAPriority) {
  (void)load_text(R"({"name": "demo", "components": [
      {"name": "a", "library": "a", "threads": {"device": {"priority": 5}, "bus": {"policy": "fifo"}}}]})");

  EXPECT_NE(text_of(problems).find("/components/0/threads/device"), std::string::npos);
  EXPECT_NE(text_of(problems).find("a \"priority\" has no meaning with the policy \"other\""),
            std::string::npos);
  EXPECT_NE(text_of(problems).find("the policy \"fifo\" needs a \"priority\" in [1, 99]"),
            std::string::npos);
}

TEST_F(LoadTest, MissingFileIsOneMistake) {
  const ApplicationDescription app = load({.file = folder / "nothing.json"}, problems);

  EXPECT_TRUE(app.components.empty());
  EXPECT_EQ(problems.all().size(), 1U);
}

TEST_F(LoadTest, FolderAndFifoAreMistakes) {
  (void)load({.file = folder.path(), .overlays = {"/dev/null"}}, problems);

  EXPECT_NE(text_of(problems).find("it is a folder"), std::string::npos);
  EXPECT_NE(text_of(problems).find("it is not a regular file"), std::string::npos);
}

TEST_F(LoadTest, SchemaThatIsNoneIsAMistake) {
  const auto file = folder.write("app.json", kApplication);

  (void)load({.file = file, .schema_file = folder.write("schema.json", "[]")}, problems);
  (void)load({.file = file, .schema_file = folder / "none.json"}, problems);

  EXPECT_NE(text_of(problems).find("this is not the schema of applications"), std::string::npos);
  EXPECT_NE(text_of(problems).find("No such file or directory"), std::string::npos);
}

TEST(Problems, AreSortedAndEachIsThereOnce) {
  Problems problems;
  problems.add(mistake({"b.json", 2, "/x"}, "second"));
  problems.add(mistake({"b.json", 1, "/y"}, "first"));
  problems.add(mistake({"b.json", 2, "/x"}, "second"));
  problems.add(mistake({"a.json", 9, ""}, "zeroth", "look there"));

  EXPECT_EQ(text_of(problems),
            "a.json:9: zeroth; look there\nb.json:1: /y: first\nb.json:2: /x: second\n");
}

TEST(Problems, OnlySoManyAreKeptButAllAreCounted) {
  Problems problems;
  for (std::size_t i = 0; i < Problems::kMaxKept + 10; ++i) {
    problems.add(mistake({"a.json", static_cast<int>(i), ""}, "wrong"));
  }

  EXPECT_EQ(problems.all().size(), Problems::kMaxKept);
  EXPECT_EQ(problems.error_count(), Problems::kMaxKept + 10);
}

}  // namespace
}  // namespace fastcycle::config

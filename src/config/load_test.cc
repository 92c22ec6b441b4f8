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
  "processes": [
    {"name": "sensing", "on_exit": "restart", "restart": {"limit": 5, "within_s": 2},
     "memory_mb": 512, "cpus": [0], "user": "root", "trusted": false,
     "sandbox": {"read": ["maps", "/"], "write": ["/tmp"]}},
    {"name": "front/camera", "on_exit": "continue", "sandbox": "strict"}
  ],
  "topics": {
    "planning/speed": {"latched": 1, "ages": false, "pool_max": 64, "keep": 3,
                       "multiple_publishers": true, "external": true},
    "/map": {}
  },
  "shared_params": {"width_m": 2},
  "components": [
    {"name": "limiter", "library": "speed_limiter", "class": "demo::SpeedLimiter",
     "namespace": "front", "executor": "control", "process": "front/camera", "serve_period_ms": 0.5, "serve_phase_ms": 0.25,
     "simulated_cost_ms": 1.5,
     "params": {"limit_mps": 22.2}, "remap": {"goal": "mission/goal"}, "on_fault": "stop",
     "log_level": "debug",
     "subscribers": {"planning/speed": {"depth": 4, "overflow": "drop_newest"}},
     "publishers": {"control/speed": {"keep": 2}},
     "threads": {"device": {"cpus": [0, 3], "policy": "rr", "priority": 40}}},
    {"name": "planner", "library": "planner"},
    {"name": "camera", "library": "camera", "process": "sensing"}
  ]
})";

struct LoadTest : testing::Test {
  void SetUp() override { std::filesystem::create_directory(folder / "maps"); }

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

  ASSERT_EQ(app.components.size(), 3U);
  const ComponentDescription& limiter = app.components[0];
  EXPECT_EQ(limiter.name, "front/limiter");
  EXPECT_EQ(limiter.name_space, "front");
  EXPECT_EQ(limiter.library, "speed_limiter");
  EXPECT_EQ(limiter.class_name, "demo::SpeedLimiter");
  EXPECT_EQ(limiter.executor, "control");
  EXPECT_EQ(limiter.process, "front/camera");
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

TEST_F(LoadTest, EveryKeyOfAProcessArrives) {
  const ApplicationDescription app = load_text(kApplication);

  EXPECT_EQ(text_of(problems), "");
  ASSERT_EQ(app.processes.size(), 2U);
  const ProcessDescription& sensing = app.processes[0];
  EXPECT_EQ(sensing.name, "sensing");
  EXPECT_EQ(sensing.on_exit, OnExit::kRestart);
  EXPECT_EQ(sensing.restart.limit, 5U);
  EXPECT_EQ(sensing.restart.within, std::chrono::seconds(2));
  EXPECT_EQ(sensing.memory_bytes, 512'000'000U);
  EXPECT_EQ(sensing.cpus, std::vector<int>{0});
  EXPECT_EQ(sensing.user, "root");
  EXPECT_FALSE(sensing.is_trusted);
  EXPECT_EQ(sensing.sandbox, Sandbox::kStrict);
  EXPECT_EQ(sensing.readable, (std::vector<std::filesystem::path>{folder / "maps", "/"}));
  EXPECT_EQ(sensing.writable, std::vector<std::filesystem::path>{"/tmp"});
  EXPECT_EQ(sensing.place.pointer, "/processes/0");
  const ProcessDescription& camera = app.processes[1];
  EXPECT_EQ(camera.name, "front/camera");
  EXPECT_EQ(camera.on_exit, OnExit::kContinue);
  EXPECT_EQ(camera.sandbox, Sandbox::kStrict);
  EXPECT_EQ(camera.memory_bytes, 0U);
  EXPECT_TRUE(camera.is_trusted);
}

TEST_F(LoadTest, ProcessesAreThoseThatComponentsAreIn) {
  const ApplicationDescription app = load_text(R"({"name": "demo",
      "processes": [{"name": "planning"}, {"name": "unused"}, {"name": "sensing", "cpus": [0]}],
      "components": [{"name": "a", "library": "a", "process": "more"},
                     {"name": "b", "library": "a", "process": "sensing"},
                     {"name": "c", "library": "a", "process": "planning"},
                     {"name": "d", "library": "a", "process": "more"},
                     {"name": "e", "library": "a", "process": "main"},
                     {"name": "f", "library": "a"}]})");

  std::vector<std::string> names;
  for (const ProcessDescription& process : app.processes) {
    names.push_back(process.name);
  }
  EXPECT_EQ(names, (std::vector<std::string>{"planning", "sensing", "more"}));
  EXPECT_EQ(app.processes[2].on_exit, OnExit::kStop);
  EXPECT_EQ(app.processes[2].place.pointer, "/components/0/process");
  EXPECT_EQ(app.components[4].process, "") << "the main process is not one of them";
  EXPECT_EQ(app.components[5].process, "");
  EXPECT_FALSE(problems.has_errors());
  EXPECT_EQ(text_of(problems), (folder / "app.json").string() +
                                   ":2: /processes/1: warning: no component is in the process "
                                   "\"unused\"\n");
}

TEST_F(LoadTest, AProcessThatIsNearlyOneThatNobodyUsesIsAWarning) {
  (void)load_text(R"({"name": "demo",
      "processes": [{"name": "sensing", "cpus": [0]}, {"name": "camera_1"}],
      "components": [{"name": "a", "library": "a", "process": "sensng"},
                     {"name": "b", "library": "a", "process": "camera_1"},
                     {"name": "c", "library": "a", "process": "camera_2"}]})");

  EXPECT_FALSE(problems.has_errors());
  EXPECT_NE(text_of(problems).find("/components/0/process: warning: the process \"sensng\" is not "
                                   "described; did you mean \"sensing\"?"),
            std::string::npos)
      << text_of(problems);
  EXPECT_EQ(text_of(problems).find("camera_2"), std::string::npos) << "one need not be described";
}

TEST_F(LoadTest, AnExecutorThatSpinsOnTheSameCpusInSeveralProcessesIsAWarning) {
  const auto said_of = [this](const std::string& executor, const std::string& process) {
    problems = Problems();
    (void)load_text(R"({"name": "demo", "executors": [{"name": "fast", )" + executor + R"(}],
        "components": [{"name": "a", "library": "a", "executor": "fast"},
                       {"name": "b", "library": "a", "executor": "fast", "process": ")" +
                    process + R"("}]})");
    EXPECT_FALSE(problems.has_errors());
    return text_of(problems);
  };

  const std::string said = said_of(R"("wait": "spin", "cpus": [0])", "sensing");
  EXPECT_NE(said.find("/executors/0/wait: warning: the executor \"fast\" spins in 2 processes, "
                      "which share its \"cpus\""),
            std::string::npos)
      << said;
  EXPECT_EQ(said_of(R"("wait": "spin", "cpus": [0])", "main"), "");
  EXPECT_EQ(said_of(R"("wait": "spin")", "sensing"), "");
  EXPECT_EQ(said_of(R"("cpus": [0])", "sensing"), "");
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

TEST_F(LoadTest, TimeSlicesAreForTheOrdinaryPolicyAlone) {
  const ApplicationDescription app = load_text(R"({"name": "demo", "executors": [
      {"name": "urgent", "slice_us": 100},
      {"name": "fifo", "policy": "fifo", "priority": 80, "slice_us": 200}], "components": [
      {"name": "a", "library": "a", "executor": "urgent", "threads": {"device": {"slice_us": 300}}},
      {"name": "b", "library": "a", "executor": "fifo"}]})");

  EXPECT_EQ(app.executors.at(0).slice_us, 100);
  EXPECT_EQ(app.components.at(0).threads.at("device").slice_us, 300);
  EXPECT_EQ(problems.all().size(), 1U);
  EXPECT_NE(text_of(problems).find("/executors/1"), std::string::npos);
  EXPECT_NE(text_of(problems).find("a \"slice_us\" has no meaning with the policy \"fifo\""),
            std::string::npos);
}

TEST_F(LoadTest, MissingFileIsOneError) {
  const ApplicationDescription app = load({.file = folder / "nothing.json"}, problems);

  EXPECT_TRUE(app.components.empty());
  EXPECT_EQ(problems.all().size(), 1U);
}

TEST_F(LoadTest, FolderAndFifoAreErrors) {
  (void)load({.file = folder.path(), .overlays = {"/dev/null"}}, problems);

  EXPECT_NE(text_of(problems).find("it is a folder"), std::string::npos);
  EXPECT_NE(text_of(problems).find("it is not a regular file"), std::string::npos);
}

TEST_F(LoadTest, SchemaThatIsNoneIsAnError) {
  const auto file = folder.write("app.json", kApplication);

  (void)load({.file = file, .schema_file = folder.write("schema.json", "[]")}, problems);
  (void)load({.file = file, .schema_file = folder / "none.json"}, problems);

  EXPECT_NE(text_of(problems).find("this is not the schema of applications"), std::string::npos);
  EXPECT_NE(text_of(problems).find("No such file or directory"), std::string::npos);
}

TEST(Problems, AreSortedAndEachIsThereOnce) {
  Problems problems;
  problems.add(make_error({"b.json", 2, "/x"}, "second"));
  problems.add(make_error({"b.json", 1, "/y"}, "first"));
  problems.add(make_error({"b.json", 2, "/x"}, "second"));
  problems.add(make_error({"a.json", 9, ""}, "zeroth", "look there"));

  EXPECT_EQ(text_of(problems),
            "a.json:9: zeroth; look there\nb.json:1: /y: first\nb.json:2: /x: second\n");
}

TEST(Problems, OnlySoManyAreKeptButAllAreCounted) {
  Problems problems;
  for (std::size_t i = 0; i < Problems::kMaxKept + 10; ++i) {
    problems.add(make_error({"a.json", static_cast<int>(i), ""}, "wrong"));
  }

  EXPECT_EQ(problems.all().size(), Problems::kMaxKept);
  EXPECT_EQ(problems.error_count(), Problems::kMaxKept + 10);
}

}  // namespace
}  // namespace fastcycle::config

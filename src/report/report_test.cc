#include "report/report.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "host/test_application.h"
#include "report/graph.h"

namespace fastcycle::host {
namespace {

using detail::DropReason;
using google::protobuf::Int64Value;
using nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// Publishes a number every Serve period, and reports how many.
class Talker final : public Component {
 public:
  explicit Talker(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}
  void serve() override {
    numbers_.publish(numbers_.loan());
    ++count_;
  }
  void stop() override { report("count", count_); }

 private:
  Publisher<Int64Value> numbers_;
  std::int64_t count_ = 0;
};

class Listener final : public Component {
 public:
  explicit Listener(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value&) { ++count_; });
  }
  void stop() override {
    report("count", count_);
    report("ratio", std::numeric_limits<double>::quiet_NaN());
    report("is_done", true);
    report("word", std::string("fine"));
    health(Health::kDegraded, "it is tired");
  }

 private:
  std::int64_t count_ = 0;
};

constexpr const char* kTwo = R"({"name": "two", "components": [
  {"name": "talker", "library": "talker", "serve_period_ms": 10},
  {"name": "listener", "library": "listener"}]})";

std::unique_ptr<Application> two_components() {
  TestClasses classes;
  classes.with<Talker>("talker").with<Listener>("listener");
  return make_application(kTwo, classes, {.is_simulated = true, .workers = 1});
}

RunReport report_of_a_run() {
  const auto application = two_components();
  application->start();
  application->run(std::chrono::seconds(1));
  application->stop();
  return make_report(*application, std::chrono::milliseconds(250));
}

std::vector<std::string> keys_of(const ordered_json& object) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : object.items()) {
    keys.push_back(key);
  }
  return keys;
}

/// How many columns the widest line takes; each character takes one.
std::size_t columns_of(const std::string& text) {
  std::size_t columns = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    columns = std::max(columns,
                       static_cast<std::size_t>(std::count_if(line.begin(), line.end(), [](char c) {
                         return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
                       })));
  }
  return columns;
}

/// A report with one subscription whose ledger is `ledger`.
RunReport report_with(const detail::Ledger& ledger) {
  RunReport report;
  report.application = "one";
  report.topics.push_back(
      {.name = "numbers", .type = "demo.Number", .published = ledger.published});
  report.topics.back().subscribers.push_back({.component = "listener", .ledger = ledger});
  return report;
}

TEST(Report, HasItsKeysInOrder) {
  const ordered_json json = to_json(report_of_a_run());

  EXPECT_THAT(keys_of(json),
              ElementsAre("application", "clock", "startup_ms", "time_s", "wall_s", "cpu_s",
                          "rss_max_kib", "end", "components", "topics", "results"));
  EXPECT_THAT(keys_of(json["components"]), ElementsAre("talker", "listener"));
  EXPECT_THAT(keys_of(json["components"]["talker"]),
              ElementsAre("state", "activations", "callback_us", "callbacks", "overruns", "faults",
                          "fault_texts", "restarts", "library", "build_id", "reloads", "rollbacks",
                          "health", "health_reason", "timer_lateness_us", "results"));
  EXPECT_THAT(keys_of(json["components"]["talker"]["callback_us"]),
              ElementsAre("p50", "p99", "max"));
  EXPECT_THAT(keys_of(json["topics"]["numbers"]),
              ElementsAre("type", "published", "allocated", "rate_hz", "subscribers"));
  const ordered_json& callback = json["components"]["talker"]["callbacks"][0];
  EXPECT_THAT(keys_of(callback), ElementsAre("name", "kind", "count", "time_us"));
  EXPECT_THAT(keys_of(callback["time_us"]), ElementsAre("mean", "p50", "p99", "max"));
  const ordered_json& subscriber = json["topics"]["numbers"]["subscribers"][0];
  EXPECT_THAT(keys_of(subscriber),
              ElementsAre("component", "kind", "depth", "published", "delivered", "dropped",
                          "queued", "adds_up", "latency_us"));
  EXPECT_THAT(keys_of(subscriber["latency_us"]),
              ElementsAre("mean", "std", "p50", "p99", "p999", "max"));
}

TEST(Report, SaysWhatHappened) {
  const ordered_json json = to_json(report_of_a_run());

  EXPECT_EQ(json["clock"], "simulated");
  EXPECT_EQ(json["end"], "time over");
  EXPECT_EQ(json["time_s"], 1.0);
  EXPECT_EQ(json["wall_s"], 0.25);
  EXPECT_GT(json["startup_ms"], 0.0);
  EXPECT_EQ(json["topics"]["numbers"]["type"], "google.protobuf.Int64Value");
  EXPECT_EQ(json["topics"]["numbers"]["published"], 100);
  EXPECT_EQ(json["topics"]["numbers"]["rate_hz"], 100.0);
  EXPECT_EQ(json["topics"]["numbers"]["subscribers"][0]["delivered"], 100);
  EXPECT_EQ(json["components"]["listener"]["health"], "degraded");
  EXPECT_EQ(json["components"]["listener"]["health_reason"], "it is tired");
}

/// Is called for messages and by two timers, and is made anew after the fifth message.
class Fickle final : public Component {
 public:
  explicit Fickle(Context& context) : Component(context) {
    context.create_timer({.period = std::chrono::milliseconds(20)}, [] {});
    context.create_subscriber<Int64Value>("numbers", [](const Sample<Int64Value>& number) {
      if (number.info().sequence == 5) {
        throw std::runtime_error("not this one");
      }
    });
  }
};

TEST(Report, TellsTheCallbacksOfAComponentApart) {
  TestClasses classes;
  classes.with<Talker>("talker").with<Fickle>("fickle");
  const auto application = make_application(R"({"name": "two", "components": [
        {"name": "talker", "library": "talker", "serve_period_ms": 10},
        {"name": "fickle", "library": "fickle", "serve_period_ms": 50, "on_fault": "restart"}]})",
                                            classes, {.is_simulated = true, .workers = 1});
  application->start();
  application->run(std::chrono::seconds(10));
  application->stop();

  const ordered_json fickle =
      to_json(make_report(*application, std::chrono::milliseconds(250)))["components"]["fickle"];

  ASSERT_EQ(fickle["restarts"], 1);
  // One of each, although its timers were made twice.
  std::vector<std::string> names;
  for (const ordered_json& callback : fickle["callbacks"]) {
    names.push_back(callback["name"].get<std::string>() + ": " +
                    callback["kind"].get<std::string>());
    EXPECT_GT(callback["count"], 100) << callback;
    EXPECT_GT(callback["time_us"]["mean"], 0.0) << callback;
    EXPECT_LE(callback["time_us"]["p50"], callback["time_us"]["max"]) << callback;
    EXPECT_LE(callback["time_us"]["max"], fickle["callback_us"]["max"]) << callback;
  }
  EXPECT_THAT(names, ElementsAre("numbers: message", "timer 0: tick", "serve: tick"));
}

TEST(Report, ResultThatTwoComponentsReportKeepsBothValues) {
  const ordered_json results = to_json(report_of_a_run())["results"];

  EXPECT_EQ(results["count"], 100);
  EXPECT_EQ(results["listener.count"], 100);
  EXPECT_EQ(results["is_done"], true);
  EXPECT_EQ(results["word"], "fine");
}

TEST(Report, ComponentHasItsOwnResults) {
  const ordered_json components = to_json(report_of_a_run())["components"];

  EXPECT_EQ(components["talker"]["results"], ordered_json::parse(R"({"count": 100})"));
  EXPECT_THAT(keys_of(components["listener"]["results"]),
              ElementsAre("count", "is_done", "ratio", "word"));
  EXPECT_EQ(components["listener"]["results"]["count"], 100);
  EXPECT_TRUE(components["listener"]["results"]["ratio"].is_null());
}

TEST(Report, ComponentWithoutResultsHasNoKeyForThem) {
  RunReport report;
  report.components.push_back({.name = "quiet"});

  EXPECT_FALSE(to_json(report)["components"]["quiet"].contains("results"));
}

TEST(Report, WhatIsNoNumberIsNull) {
  const ordered_json json = to_json(report_of_a_run());

  EXPECT_TRUE(json["results"]["ratio"].is_null());
  // It has no timer, so its timers were never late.
  EXPECT_TRUE(json["components"]["listener"]["timer_lateness_us"]["max"].is_null());
}

TEST(Report, ApplicationThatPublishedNothingHasNoStartupTime) {
  const auto application = two_components();
  application->start();
  application->stop();

  const RunReport report = make_report(*application, Duration(0));

  EXPECT_FALSE(report.startup_ms);
  EXPECT_TRUE(to_json(report)["startup_ms"].is_null());
  EXPECT_TRUE(to_json(report)["topics"]["numbers"]["rate_hz"].is_null());
  EXPECT_THAT(to_table(report), Not(HasSubstr("first message")));
}

TEST(Report, ProgressCountsWhileTheApplicationRuns) {
  const auto application = two_components();
  application->start();
  application->advance_to(application->start_time() + std::chrono::milliseconds(50));

  const Progress progress = progress_of(*application);

  EXPECT_EQ(progress.time, std::chrono::milliseconds(50));
  EXPECT_EQ(progress.published, 5U);
  EXPECT_EQ(progress.dropped, 0U);
  EXPECT_EQ(progress.faults, 0U);
}

TEST(ReportTable, ShowsTheLedgerWithItsReasons) {
  detail::Ledger ledger{.published = 10, .delivered = 5, .queued = 1};
  ledger.dropped[static_cast<std::size_t>(DropReason::kOverflow)] = 3;
  ledger.dropped[static_cast<std::size_t>(DropReason::kShutdown)] = 1;

  const std::string table = to_table(report_with(ledger));

  EXPECT_THAT(table, HasSubstr("10 = 5 delivered + 3 overflow + 1 shutdown + 1 queued"));
  EXPECT_THAT(table, Not(HasSubstr("DOES NOT ADD UP")));
}

TEST(ReportTable, LedgerThatDoesNotAddUpIsNamed) {
  const RunReport report = report_with({.published = 10, .delivered = 9});

  EXPECT_THAT(to_table(report), HasSubstr("10 = 9 delivered  DOES NOT ADD UP"));
  EXPECT_EQ(to_json(report)["topics"]["numbers"]["subscribers"][0]["adds_up"], false);
}

TEST(ReportTable, EveryFaultIsNamedWithItsComponent) {
  RunReport report;
  report.components.push_back(
      {.name = "camera", .faults = 3, .fault_texts = {"no light", "no lens"}});

  const std::string table = to_table(report);

  EXPECT_THAT(table, HasSubstr("fault of camera: no light\n"));
  EXPECT_THAT(table, HasSubstr("fault of camera: no lens\n"));
  EXPECT_THAT(table, HasSubstr("fault of camera: 1 more\n"));
}

TEST(ReportTable, NamesWhyMessagesAreLostOnTheWayToAnotherProcess) {
  RunReport report;
  report.processes.push_back(
      {.name = "main",
       .links = {{.topic = "numbers", .to = "sinks", .given = 7, .unshared = 2, .overflowed = 1}}});

  const std::string table = to_table(report);
  EXPECT_THAT(table, HasSubstr("numbers: lost on the way to process sinks: 1 (its queue was full), "
                               "2 (not in shared memory"));
}

TEST(ReportTable, StaysWithin120Columns) {
  const std::string long_name = "front/" + std::string(230, 'a') + "/end";
  constexpr std::uint64_t kMany = 12'345'678'901'234;
  detail::Ledger ledger{.published = kMany, .delivered = kMany, .queued = kMany};
  ledger.dropped.fill(kMany);
  const base::HistogramSummary slow{.count = 1,
                                    .mean = 1e10,
                                    .standard_deviation = 1e10,
                                    .p50 = 1e10,
                                    .p99 = 1e10,
                                    .p999 = 1e10,
                                    .max = 1e10};
  RunReport report = report_with(ledger);
  report.topics[0].name = long_name;
  report.topics[0].type = "a.very.long.package." + std::string(100, 'T');
  report.topics[0].subscribers[0].component = long_name;
  report.topics[0].subscribers[0].kind = detail::Subscription::Kind::kHistory;
  report.topics[0].subscribers[0].latency = slow;
  report.components.push_back(
      {.name = long_name,
       .activations = kMany,
       .callback = slow,
       .timer_lateness = slow,
       .overruns = kMany,
       .faults = 2,
       .fault_texts = {std::string(300, 'x'), "word " + std::string(200, 'y')}});
  report.results.push_back({"z", long_name, std::string(500, 'z')});

  EXPECT_LE(columns_of(to_table(report)), 120U) << to_table(report);
}

TEST(ReportTable, WhatWouldMoveTheCursorIsABlank) {
  RunReport report;
  report.components.push_back(
      {.name = "camera", .faults = 1, .fault_texts = {"two\nlines\x1b[2J"}});

  EXPECT_THAT(to_table(report), HasSubstr("two lines [2J"));
}

TEST(Graph, NamesComponentsTopicsAndTypes) {
  const std::string dot = to_dot(*two_components());

  EXPECT_THAT(dot, HasSubstr("<b>talker</b>"));
  EXPECT_THAT(dot, HasSubstr("every 10 ms"));
  EXPECT_THAT(dot, HasSubstr("<b>numbers</b>"));
  EXPECT_THAT(dot, HasSubstr("google.protobuf.Int64Value"));
  EXPECT_THAT(dot, HasSubstr("component_0 -> topic_0;"));
  EXPECT_THAT(dot, HasSubstr("topic_0 -> component_1;"));
  EXPECT_THAT(dot, Not(HasSubstr("subgraph")));
}

/// What stands between the braces of the process's frame.
std::string frame_of(const std::string& dot, const std::string& process) {
  const std::size_t label = dot.find("label=<<b>" + process + "</b> process>");
  const std::size_t end = dot.find("\n  subgraph cluster_", label);
  return label == std::string::npos ? "" : dot.substr(label, end - label);
}

TEST(Graph, ProcessesAreFramesWithTheTopicsThatDoNotLeaveThem) {
  using Component = Drawing::Component;
  const Drawing drawing{
      .name = "demo",
      .components = {Component{.name = "front/lidar", .name_space = "front", .process = "sensing"},
                     Component{.name = "filter", .process = "sensing"},
                     Component{.name = "planner"}},
      .topics = {{.name = "points",
                  .publishers = {{.component = "front/lidar"}},
                  .subscribers = {{.component = "filter"}}},
                 {.name = "objects",
                  .publishers = {{.component = "filter"}},
                  .subscribers = {{.component = "planner"}}}}};

  const std::string dot = to_dot(drawing);

  const std::string main = frame_of(dot, "main");
  const std::string sensing = dot.substr(0, dot.find("<b>main</b> process"));
  EXPECT_THAT(sensing, HasSubstr("<b>sensing</b> process"));
  EXPECT_THAT(sensing, HasSubstr("label=<front>"));
  EXPECT_THAT(sensing, HasSubstr("component_0 ["));
  EXPECT_THAT(sensing, HasSubstr("component_1 ["));
  EXPECT_THAT(sensing, HasSubstr("topic_0 ["));
  EXPECT_THAT(sensing, Not(HasSubstr("component_2 [")));
  EXPECT_THAT(sensing, Not(HasSubstr("topic_1 [")));
  EXPECT_THAT(main.substr(0, main.find("\n  }\n")), HasSubstr("component_2 ["));
  EXPECT_THAT(main.substr(0, main.find("\n  }\n")), Not(HasSubstr("topic_1 [")));
  EXPECT_THAT(main, HasSubstr("topic_1 ["));
  EXPECT_THAT(dot, HasSubstr("topic_0 -> component_1;"));
  EXPECT_EQ(std::ranges::count(dot, '{'), std::ranges::count(dot, '}'));
}

TEST(Graph, ComponentsSayTheirProcess) {
  TestClasses classes;
  classes.with<Talker>("talker").with<Listener>("listener");
  const auto application = make_application(R"({"name": "two", "components": [
      {"name": "talker", "library": "talker", "process": "sensing"},
      {"name": "listener", "library": "listener", "process": "main"}]})",
                                            classes);

  const Drawing drawing = drawing_of(*application);

  ASSERT_EQ(drawing.components.size(), 2U);
  EXPECT_EQ(drawing.components[0].process, "sensing");
  EXPECT_EQ(drawing.components[1].process, "");
}

}  // namespace
}  // namespace fastcycle::host

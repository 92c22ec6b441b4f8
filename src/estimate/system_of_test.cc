#include "estimate/system_of.h"

#include <algorithm>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "estimate/analysis.h"
#include "estimate/read_timing.h"
#include "estimate/text.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::estimate {
namespace {

using google::protobuf::Int64Value;
using std::chrono::milliseconds;
using testing::HasSubstr;

class Lidar final : public fastcycle::Component {
 public:
  explicit Lidar(Context& context)
      : Component(context), points_(context.create_external_publisher<Int64Value>("points")) {}

 private:
  ExternalPublisher<Int64Value> points_;
};

/// Subscribes to points, publishes objects; its Serve Timer only counts.
class Filter final : public fastcycle::Component {
 public:
  explicit Filter(Context& context)
      : Component(context), objects_(context.create_publisher<Int64Value>("objects")) {
    context.create_subscriber<Int64Value>("points", {.depth = 4}, [](const Int64Value&) {});
  }

 private:
  Publisher<Int64Value> objects_;
};

/// Looks at the last object each 20 ms.
class Control final : public fastcycle::Component {
 public:
  explicit Control(Context& context)
      : Component(context),
        objects_(context.create_latest<Int64Value>("objects")),
        command_(context.create_publisher<Int64Value>("command")) {
    context.create_timer({.period = milliseconds(20)}, [] {});
  }

 private:
  Latest<Int64Value> objects_;
  Publisher<Int64Value> command_;
};

class Brakes final : public fastcycle::Component {
 public:
  explicit Brakes(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("command", [](const Int64Value&) {});
    context.create_synchronizer<Int64Value, Int64Value>(
        {"objects", "points"},
        {.policy = SyncPolicy::kApproximate, .max_difference = milliseconds(5)},
        [](const Int64Value&, const Int64Value&) {});
  }
};

constexpr const char* kApplication = R"({"name": "a",
  "executors": [{"name": "fast", "cpus": [1], "policy": "fifo", "priority": 10},
                {"name": "slow", "threads": 2, "wait": "adaptive"}],
  "components": [{"name": "lidar", "library": "lidar", "executor": "slow"},
                 {"name": "filter", "library": "filter", "executor": "slow", "serve_period_ms": 50},
                 {"name": "control", "library": "control", "executor": "fast"},
                 {"name": "brakes", "library": "brakes", "executor": "fast"}],
  "chains": [{"name": "braking", "from": "points", "to": "command", "deadline_ms": 300}]})";

class ASystem : public testing::Test {
 protected:
  ASystem()
      : application_(host::make_application(kApplication,
                                            classes_.with<Lidar>("lidar")
                                                .with<Filter>("filter")
                                                .with<Control>("control")
                                                .with<Brakes>("brakes"),
                                            {.is_simulated = true, .workers = 1})) {}

  System make(const Timing& timing = {}) {
    return system_of(*application_, timing, {.cpus = 4}, problems_);
  }
  static const Callback& callback(const System& system, const std::string& component,
                                  const std::string& name) {
    for (const Callback& callback : system.callbacks) {
      if (system.components[callback.component].name == component && callback.name == name) {
        return callback;
      }
    }
    throw std::runtime_error(component + " has no callback " + name);
  }
  std::string errors() {
    std::string text;
    for (const config::Problem& problem : problems_.all()) {
      text += problem.message + (problem.hint.empty() ? "" : "; " + problem.hint) + "\n";
    }
    return text;
  }

  host::TestClasses classes_;
  std::unique_ptr<host::Application> application_;
  config::Problems problems_;
};

TEST_F(ASystem, HasWhatCallsTheComponentsAndWhereTheyRun) {
  const System system = make();
  EXPECT_EQ(errors(), "");
  ASSERT_EQ(system.executors.size(), 2U);
  EXPECT_EQ(system.executors[0].priority, 10);
  EXPECT_EQ(system.executors[1].threads, 2U);
  EXPECT_GT(system.executors[1].looks_for, Duration());
  EXPECT_EQ(callback(system, "filter", "points").inputs[0].depth, 4U);
  EXPECT_EQ(callback(system, "filter", "serve").arrivals->period, milliseconds(50));
  EXPECT_EQ(callback(system, "control", "timer 0").arrivals->period, milliseconds(20));
  EXPECT_EQ(callback(system, "brakes", "objects + points").joining, Joining::kSets);
  EXPECT_EQ(callback(system, "brakes", "objects + points").max_difference, milliseconds(5));
  ASSERT_EQ(system.views.size(), 1U);
  ASSERT_EQ(system.sources.size(), 1U);
  EXPECT_FALSE(system.sources[0].arrivals);
  ASSERT_EQ(system.chains.size(), 1U);
  EXPECT_EQ(system.chains[0].deadline, milliseconds(300));
}

TEST_F(ASystem, HasAnExecutorOnceInEachProcess) {
  const auto application = host::make_application(
      R"({"name": "a",
          "executors": [{"name": "fast", "cpus": [1, 2]}, {"name": "slow", "threads": 2}],
          "processes": [{"name": "sensing", "cpus": [2, 3]}],
          "components": [
            {"name": "lidar", "library": "lidar", "executor": "slow", "process": "sensing"},
            {"name": "filter", "library": "filter", "executor": "fast", "process": "sensing"},
            {"name": "control", "library": "control", "executor": "fast"},
            {"name": "brakes", "library": "brakes", "executor": "fast", "process": "acting"}]})",
      classes_, {.is_simulated = true, .workers = 1});

  const System system = system_of(*application, {}, {.cpus = 4}, problems_);

  const auto executor_of = [&](const std::string& name) {
    const auto found = std::ranges::find(system.components, name, &Component::name);
    return system.executors.at(found->executor);
  };
  EXPECT_EQ(executor_of("control").name, "fast");
  EXPECT_EQ(executor_of("control").cpus, (std::vector<int>{1, 2}));
  EXPECT_EQ(executor_of("filter").name, "sensing/fast");
  EXPECT_EQ(executor_of("filter").cpus, std::vector<int>{2});
  EXPECT_EQ(executor_of("lidar").name, "sensing/slow");
  EXPECT_EQ(executor_of("lidar").threads, 2U);
  EXPECT_EQ(executor_of("lidar").cpus, (std::vector<int>{2, 3}));
  EXPECT_EQ(executor_of("brakes").name, "acting/fast");
  EXPECT_EQ(executor_of("brakes").cpus, (std::vector<int>{1, 2}));
}

TEST_F(ASystem, TakesIntoAccountWhatTimingSays) {
  Timing timing;
  timing.components["filter"].callbacks["points"].run_time = milliseconds(3);
  timing.components["filter"].callbacks["points"].publishes = {{"objects", 1}};
  timing.components["filter"].callbacks["serve"].publishes.emplace();
  timing.components["filter"].run_time = milliseconds(1);
  timing.components["control"].run_time = milliseconds(1);
  timing.components["brakes"].run_time = milliseconds(1);
  timing.sources["points"].arrivals = {milliseconds(100)};
  const System system = make(timing);
  EXPECT_EQ(errors(), "");
  EXPECT_EQ(callback(system, "filter", "points").run_time, milliseconds(3));
  EXPECT_EQ(callback(system, "filter", "serve").run_time, milliseconds(1));
  EXPECT_TRUE(callback(system, "filter", "serve").publishes.empty());
  const Estimate estimate = analyze(system);
  EXPECT_EQ(estimate.chains[0].verdict, Verdict::kHolds) << to_text(system, estimate);
}

TEST_F(ASystem, SaysWhatIsMissingBeforeAChainCanBeCalledSafe) {
  Timing timing;
  timing.components["filter"].run_time = milliseconds(1);
  const Estimate estimate = analyze(make(timing));
  EXPECT_EQ(estimate.chains[0].verdict, Verdict::kNotShown);
  EXPECT_THAT(estimate.chains[0].reasons,
              testing::Contains("the rate of \"points\" from the threads of \"lidar\" is unknown"));
}

TEST_F(ASystem, TakesRunTimesFromARecording) {
  const std::filesystem::path file = testing::TempDir() + "estimate_recorded.mcap";
  std::filesystem::remove(file);
  auto application =
      host::make_application(kApplication, classes_, {.is_simulated = true, .workers = 1});
  application.reset();
  config::Problems problems;
  application =
      std::make_unique<host::Application>(host::describe_text(kApplication, problems),
                                          host::ClockOptions{.is_simulated = true, .workers = 1});
  config::RecordDescription recording;
  recording.file = file;
  application->record(recording);
  application->build(classes_, problems, host::ConstructorFault::kFault);
  application->start();
  application->run(milliseconds(200));
  application->stop();
  application.reset();
  ASSERT_FALSE(problems.has_errors());

  Timing timing;
  read_timing(file, 1000.0, timing, problems_);
  EXPECT_EQ(errors(), "");
  const System system = make(timing);
  EXPECT_EQ(errors(), "");
  EXPECT_GT(callback(system, "filter", "serve").run_time, Duration());
  EXPECT_GT(callback(system, "control", "timer 0").run_time, Duration());
  EXPECT_FALSE(callback(system, "filter", "points").run_time) << "it was never called";
  std::filesystem::remove(file);
}

TEST_F(ASystem, HasNoneThatTimingNamesAndNobodyIs) {
  Timing timing;
  timing.components["fliter"].is_given = true;
  timing.components["filter"].callbacks["point"].is_given = true;
  timing.components["control"].callbacks["timer 0"].publishes = {{"comand", 1}};
  timing.sources["objects"].arrivals = {milliseconds(1)};
  make(timing);
  EXPECT_THAT(errors(), HasSubstr("there is no component \"fliter\"; did you mean \"filter\"?"));
  EXPECT_THAT(errors(), HasSubstr("\"filter\" has no callback \"point\", only \"points\", "
                                  "\"serve\", \"timer 0\"; did you mean \"points\"?"));
  EXPECT_THAT(errors(), HasSubstr("there is no topic \"comand\"; did you mean \"command\"?"));
  EXPECT_THAT(errors(), HasSubstr("no thread of a component publishes \"objects\""));
}

}  // namespace
}  // namespace fastcycle::estimate

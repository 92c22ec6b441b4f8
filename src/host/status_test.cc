#include "host/status.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "component/own_names.h"
#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/prepare_replay.h"
#include "host/test_application.h"
#include "report/report.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using namespace std::chrono_literals;

/// Publishes ten numbers each Serve period. What goes wrong, and in which call of `serve`, its
/// params say.
class Worker final : public Component {
 public:
  explicit Worker(Context& context)
      : Component(context),
        degraded_at_(context.param<std::int64_t>("degraded_at", {.fallback = 0})),
        throws_at_(context.param<std::int64_t>("throws_at", {.fallback = 0})),
        what_(context.param<std::string>("what", {.fallback = "it broke"})),
        numbers_(context.create_publisher<Int64Value>(context.component_name() + "/numbers")) {}

  void serve() override {
    ++calls_;
    for (int i = 0; i < 10; ++i) {
      auto number = numbers_.loan();
      number->set_value(calls_);
      numbers_.publish(std::move(number));
    }
    if (calls_ == degraded_at_.get()) {
      health(Health::kDegraded, "it is tired");
    } else if (calls_ == degraded_at_.get() + 1) {
      health(Health::kDegraded, "it is very tired");
    } else if (calls_ == degraded_at_.get() + 2) {
      health(Health::kOk);
    }
    if (calls_ == throws_at_.get()) {
      throw std::runtime_error(what_.get() == "bytes" ? "\xff\xfe broken" : what_.get());
    }
  }

 private:
  Param<std::int64_t> degraded_at_;
  Param<std::int64_t> throws_at_;
  Param<std::string> what_;
  Publisher<Int64Value> numbers_;
  std::int64_t calls_ = 0;
};

/// Listens to two workers, with room for four messages.
class Listener final : public Component {
 public:
  explicit Listener(Context& context) : Component(context) {
    for (const char* topic : {"first/numbers", "second/numbers"}) {
      context.create_subscriber<Int64Value>(topic, {.depth = 4}, [](const Int64Value&) {});
    }
  }
};

/// Writes down each status: when it came, and what it was.
class Supervisor final : public Component {
 public:
  explicit Supervisor(Context& context) : Component(context) {
    context.create_subscriber<status::Status>(
        kStatusTopic, {.depth = 64}, [this](const status::Status& status) {
          const std::int64_t ms = (now() - start_time()) / 1ms;
          seen_ += std::to_string(ms) + " " + status.ShortDebugString() + "\n";
          statuses_.emplace_back(ms, status);
        });
  }

  void stop() override { report("seen", seen_); }

  /// Those that came at `ms`.
  [[nodiscard]] std::vector<status::Status> at(std::int64_t ms) const {
    std::vector<status::Status> found;
    for (const auto& [time, status] : statuses_) {
      if (time == ms) {
        found.push_back(status);
      }
    }
    return found;
  }

 private:
  std::string seen_;
  std::vector<std::pair<std::int64_t, status::Status>> statuses_;
};

/// Takes the status with it from 1500 ms on.
class Latecomer final : public Component {
 public:
  explicit Latecomer(Context& context)
      : Component(context), timer_(context.create_timer([this] {
          this->context().create_subscriber<status::Status>(
              kStatusTopic, [this](const status::Status& status) {
                const Time taken{Duration(status.header().taken_ns())};
                received_ += std::to_string((now() - start_time()) / 1ms) + ":" +
                             std::to_string((taken - start_time()) / 1ms) + " ";
              });
        })) {}

  void start() override { timer_.arm_at(now() + 1500ms); }
  void stop() override { report("received", received_); }

 private:
  Timer timer_;
  std::string received_;
};

class Intruder final : public Component {
 public:
  explicit Intruder(Context& context)
      : Component(context), own_(context.create_publisher<Int64Value>("/fastcycle/own")) {}

 private:
  Publisher<Int64Value> own_;
};

TestClasses& classes() {
  static TestClasses all;
  return all.with<Worker>("worker")
      .with<Listener>("listener")
      .with<Supervisor>("supervisor")
      .with<Latecomer>("latecomer")
      .with<Intruder>("intruder");
}

constexpr const char* kSupervisor = R"({"name": "supervisor", "library": "supervisor"})";

std::string application_text(std::string components, const std::string& more = {}) {
  if (components.ends_with(", ")) {
    components.resize(components.size() - 2);
  }
  return R"({"name": "car", )" + more + R"("components": [)" + components + "]}";
}

/// A simulated application that has run for a while, and has not stopped.
class Drive {
 public:
  explicit Drive(const std::string& components, Duration span = 5s, unsigned workers = 1,
                 const std::string& more = {})
      : application(make_application(application_text(components, more), classes(),
                                     {.is_simulated = true, .workers = workers})) {
    application->start();
    application->run(span);
  }

  [[nodiscard]] const detail::ComponentCore* find(const std::string& name) const {
    const auto& all = application->components();
    const auto found =
        std::ranges::find_if(all, [&](const auto& core) { return core->name == name; });
    return found == all.end() ? nullptr : found->get();
  }

  /// What the supervisor saw at `ms`; once.
  [[nodiscard]] status::Status seen_at(std::int64_t ms) const {
    const auto seen = static_cast<const Supervisor*>(find("supervisor")->component)->at(ms);
    EXPECT_EQ(seen.size(), 1U) << "at " << ms;
    return seen.empty() ? status::Status() : seen.back();
  }
  [[nodiscard]] bool saw_nothing_at(std::int64_t ms) const {
    return static_cast<const Supervisor*>(find("supervisor")->component)->at(ms).empty();
  }

  std::unique_ptr<Application> application;
};

std::vector<std::string> names_of(const Drive& drive) {
  std::vector<std::string> names;
  for (const auto& component : drive.application->components()) {
    names.push_back(component->name);
  }
  return names;
}

status::Component component_of(const status::Status& status, const std::string& name) {
  for (const status::Component& component : status.components()) {
    if (component.name() == name) {
      return component;
    }
  }
  return {};
}

std::optional<status::Subscription> subscription_of(const status::Status& status,
                                                    const std::string& topic) {
  for (const status::Subscription& subscription : status.subscriptions()) {
    if (subscription.topic() == topic) {
      return subscription;
    }
  }
  return std::nullopt;
}

std::string worker(const std::string& name, const std::string& params,
                   const std::string& more = {}) {
  return R"({"name": ")" + name + R"(", "library": "worker", "serve_period_ms": 100, )" + more +
         R"("params": {)" + params + "}}, ";
}

TEST(TheStatus, ComesAtTheStartAndThenPeriodically) {
  const Drive drive(worker("first", "") + kSupervisor, 2500ms);

  const status::Status at_start = drive.seen_at(0);
  EXPECT_EQ(at_start.application(), "car");
  EXPECT_EQ(at_start.mode(), "");
  ASSERT_EQ(at_start.components_size(), 2);
  EXPECT_EQ(at_start.components(0).name(), "first");
  EXPECT_EQ(at_start.components(1).name(), "supervisor");
  EXPECT_EQ(at_start.components(0).state(), status::STATE_ACTIVE);
  const status::Status after_a_second = drive.seen_at(1000);
  EXPECT_EQ(Time(Duration(after_a_second.header().taken_ns())),
            drive.application->start_time() + 1s);
  // Its start, that of its timers, and ten ticks.
  EXPECT_EQ(component_of(after_a_second, "first").activations(), 12U);
  EXPECT_TRUE(drive.saw_nothing_at(1500));
  EXPECT_EQ(component_of(drive.seen_at(2000), "first").activations(), 22U);
}

TEST(TheStatus, TellsAtOnceOfAnotherHealth) {
  const Drive drive(worker("first", R"("degraded_at": 3)") + kSupervisor);

  const status::Component degraded = component_of(drive.seen_at(300), "first");
  EXPECT_EQ(degraded.health(), status::HEALTH_DEGRADED);
  EXPECT_EQ(degraded.health_reason(), "it is tired");
  EXPECT_TRUE(drive.saw_nothing_at(400)) << "another reason waits for the period";
  EXPECT_EQ(component_of(drive.seen_at(500), "first").health(), status::HEALTH_OK);
}

TEST(TheStatus, TellsInItsPeriodOfAnotherReason) {
  const Drive drive(worker("first", R"("degraded_at": 9)") + kSupervisor);

  EXPECT_EQ(component_of(drive.seen_at(900), "first").health_reason(), "it is tired");
  EXPECT_EQ(component_of(drive.seen_at(1100), "first").health_reason(), "");
  const auto& supervisor = *static_cast<const Supervisor*>(drive.find("supervisor")->component);
  ASSERT_FALSE(supervisor.at(1000).empty());
}

TEST(TheStatus, TellsAtOnceOfAFault) {
  const Drive drive(worker("first", R"("throws_at": 2)") + kSupervisor);

  const status::Component failed = component_of(drive.seen_at(200), "first");
  EXPECT_EQ(failed.state(), status::STATE_FAILED);
  EXPECT_EQ(failed.faults(), 1U);
  EXPECT_EQ(failed.restarts(), 0U);
  EXPECT_EQ(failed.last_fault(), "its serve() threw: it broke");
  EXPECT_EQ(component_of(drive.seen_at(1000), "first").faults(), 1U);
}

TEST(TheStatus, TellsAtOnceOfARestart) {
  const Drive drive(
      worker("first", R"("throws_at": 2)", R"("on_fault": "restart", )") + kSupervisor, 900ms);

  const status::Component restarted = component_of(drive.seen_at(200), "first");
  EXPECT_EQ(restarted.state(), status::STATE_ACTIVE);
  EXPECT_EQ(restarted.faults(), 1U);
  EXPECT_EQ(restarted.restarts(), 1U);
  EXPECT_THAT(restarted.last_fault(), HasSubstr("it broke (restarting)"));
  // Three restarts are enough.
  const status::Component failed = component_of(drive.seen_at(800), "first");
  EXPECT_EQ(failed.state(), status::STATE_FAILED);
  EXPECT_EQ(failed.faults(), 4U);
  EXPECT_EQ(failed.restarts(), 3U);
}

TEST(TheStatus, TellsAtOnceOfAnotherMode) {
  const Drive drive(
      worker("first", R"("throws_at": 2)", R"("fault_mode": "limp", )") + worker("second", "") +
          kSupervisor,
      900ms, 1,
      R"("modes": {"normal": {"components": ["first"]}, "limp": {"components": ["second"]}},
         "initial_mode": "normal", )");

  const status::Status before = drive.seen_at(0);
  EXPECT_EQ(before.mode(), "normal");
  EXPECT_EQ(component_of(before, "second").state(), status::STATE_STANDBY);
  const auto& supervisor = *static_cast<const Supervisor*>(drive.find("supervisor")->component);
  const std::vector<status::Status> seen = supervisor.at(200);
  ASSERT_FALSE(seen.empty());
  EXPECT_EQ(seen.back().mode(), "limp");
  EXPECT_EQ(component_of(seen.back(), "first").state(), status::STATE_FAILED);
  EXPECT_EQ(component_of(seen.back(), "second").state(), status::STATE_ACTIVE);
}

TEST(TheStatus, SaysWhatNoTextIsInLettersThatAre) {
  const Drive drive(worker("first", R"("throws_at": 2, "what": "bytes")") + kSupervisor);

  EXPECT_EQ(component_of(drive.seen_at(200), "first").last_fault(), "its serve() threw: ?? broken");
}

TEST(TheStatus, TellsOfDropsAndAges) {
  const Drive drive(worker("first", "") + worker("second", R"("throws_at": 4)") +
                    R"({"name": "listener", "library": "listener"}, )" + kSupervisor);

  const auto first = subscription_of(drive.seen_at(1000), "first/numbers");
  ASSERT_TRUE(first);
  EXPECT_EQ(first->component(), "listener");
  EXPECT_EQ(first->published(), 100U);
  ASSERT_EQ(first->drops_size(), 1);
  EXPECT_EQ(first->drops(0).reason(), "overflow");
  EXPECT_EQ(first->drops(0).count(), 60U);
  // Handed over when the round was over: they wait.
  EXPECT_EQ(first->queued(), 4U);
  EXPECT_EQ(first->delivered(), 36U);
  EXPECT_EQ(first->age_ms(), 0.0);
  const auto second = subscription_of(drive.seen_at(1000), "second/numbers");
  ASSERT_TRUE(second);
  EXPECT_EQ(second->age_ms(), 600.0);
  const auto none = subscription_of(drive.seen_at(0), "second/numbers");
  ASSERT_TRUE(none);
  EXPECT_FALSE(none->has_age_ms());
}

TEST(ManyStatuses, AreTheSameForAnyNumberOfWorkers) {
  const std::string components =
      worker("first", R"("degraded_at": 5, "throws_at": 11)", R"("on_fault": "restart", )") +
      worker("second", R"("degraded_at": 5, "throws_at": 11)", R"("fault_mode": "limp", )") +
      worker("third", R"("throws_at": 5)", R"("on_fault": "restart", )") +
      R"({"name": "listener", "library": "listener"}, )" + kSupervisor;
  const auto seen = [&](unsigned workers) {
    Drive drive(
        components, 5s, workers,
        R"("modes": {"normal": {"components": ["second"]}, "limp": {"components": ["third"]}},
                   "initial_mode": "normal", )");
    drive.application->stop();
    return std::get<std::string>(drive.find("supervisor")->results.at("seen"));
  };
  const std::string one = seen(1);

  EXPECT_THAT(one, HasSubstr("restarts: 3"));
  EXPECT_THAT(one, HasSubstr("mode: \"limp\""));
  EXPECT_GT(std::ranges::count(one, '\n'), 10);
  for (const unsigned workers : {1U, 2U, 4U, 4U}) {
    EXPECT_EQ(seen(workers), one) << workers;
  }
}

TEST(TheStatus, IsNotThereIfNobodySubscribes) {
  Drive drive(worker("first", R"("throws_at": 2)") + worker("second", ""), 1s);
  drive.application->stop();

  EXPECT_THAT(names_of(drive), ElementsAre("first", "second"));
  EXPECT_EQ(drive.application->topics().find(kStatusTopic), nullptr);
  for (const TopicReport& topic : make_report(*drive.application, 1s).topics) {
    EXPECT_THAT(topic.name, Not(HasSubstr("fastcycle")));
  }
}

TEST(TheStatus, ComesFromTheLastComponent) {
  Drive drive(std::string(kSupervisor) + ", " + worker("first", "") + worker("second", "") +
                  R"({"name": "listener", "library": "listener"})",
              1s);

  EXPECT_THAT(names_of(drive),
              ElementsAre("supervisor", "first", "second", "listener", "fastcycle"));
}

TEST(TheStatus, KeepsNoSimulationFromItsEnd) {
  auto application = make_application(application_text(kSupervisor), classes(),
                                      {.is_simulated = true, .workers = 1});
  application->start();
  EXPECT_EQ(application->run(std::nullopt), EndReason::kIdle);
  application->stop();
}

TEST(TheStatus, GivesALateJoinerTheLastOne) {
  Drive drive(std::string(kSupervisor) + R"(, {"name": "latecomer", "library": "latecomer"})",
              2500ms);
  drive.application->stop();

  EXPECT_EQ(std::get<std::string>(drive.find("latecomer")->results.at("received")),
            "1500:1000 2000:2000 ");
}

TEST(TheStatus, ComesAsOftenAsTheApplicationSays) {
  auto application = make_application(application_text(kSupervisor, R"("status_period_ms": 250, )"),
                                      classes(), {.is_simulated = true, .workers = 1});
  application->start();
  application->run(1s);

  // At the start, and at 250, 500, 750 and 1000 ms.
  EXPECT_EQ(application->topics().find(kStatusTopic)->publishers.at(0)->published(), 5U);
}

TEST(TheStatus, IsThereForARecorderThatNamesIt) {
  const auto has_status = [](const std::string& topics) {
    config::TestFolder folder;
    Application application(
        [&] {
          config::Problems problems;
          return describe_text(application_text(worker("first", "") + worker("second", "")),
                               problems);
        }(),
        {.is_simulated = true, .workers = 1});
    config::RecordDescription record;
    record.file = folder.path() / "run.mcap";
    if (!topics.empty()) {
      record.topics = {topics};
    }
    application.record(record);
    config::Problems problems;
    application.build(classes(), problems, ConstructorFault::kFault);
    return application.topics().find(kStatusTopic) != nullptr;
  };
  EXPECT_TRUE(has_status("fastcycle/status"));
  EXPECT_TRUE(has_status("/fastcycle/status"));
  EXPECT_FALSE(has_status("first/*"));
  EXPECT_FALSE(has_status(""));
}

std::string errors_of(const std::string& text) {
  config::Problems problems;
  Application application(describe_text(text, problems), {.is_simulated = true, .workers = 1});
  if (!problems.has_errors()) {
    application.build(classes(), problems, ConstructorFault::kFault);
  }
  std::string all;
  for (const config::Problem& problem : problems.all()) {
    all += config::to_string(problem) + "\n";
  }
  return all;
}

TEST(WhatIsFastCyclesOwn, IsTakenByNobodyElse) {
  EXPECT_THAT(
      errors_of(application_text(R"({"name": "fastcycle", "library": "supervisor"})")),
      HasSubstr("the component \"fastcycle\" needs another name: \"fastcycle\" is the component of "
                "FastCycle itself"));
  EXPECT_THAT(errors_of(application_text(
                  R"({"name": "x", "namespace": "fastcycle", "library": "supervisor"})")),
              HasSubstr("needs another name"));
  EXPECT_THAT(errors_of(application_text(R"({"name": "intruder", "library": "intruder"})")),
              HasSubstr("component \"intruder\" publishes on \"fastcycle/own\", but what begins "
                        "with \"fastcycle/\" only FastCycle itself publishes"));
  EXPECT_THAT(errors_of(application_text(kSupervisor)), IsEmpty());
}

TEST(ABench, MayFeedAStatusToASupervisor) {
  fastcycle::testing::Bench bench;
  bench.add<Supervisor>("supervisor");
  auto statuses = bench.input<status::Status>(kStatusTopic);
  bench.start();
  status::Status status;
  status.set_application("another");
  statuses.publish(status);
  bench.stop();

  EXPECT_EQ(std::get<std::string>(bench.result("supervisor", "seen")),
            "0 application: \"another\"\n");
}

std::atomic<int> g_live_step{0};  // What the supervisor has received.

/// Is degraded, well and broken, each until the supervisor was notified of it.
class LiveWorker final : public Component {
 public:
  explicit LiveWorker(Context& context) : Component(context) {}

  void serve() override {
    if (g_live_step == 0) {
      health(Health::kDegraded, "it is tired");
    } else if (g_live_step == 1) {
      health(Health::kOk);
    } else {
      throw std::runtime_error("it broke");
    }
  }
};

/// Ends a live run once it was notified that its neighbour was degraded, well again, and failed.
class LiveSupervisor final : public Component {
 public:
  explicit LiveSupervisor(Context& context) : Component(context), source_(context.create_source()) {
    context.create_subscriber<status::Status>(kStatusTopic, [this](const status::Status& status) {
      const status::Component worker = component_of(status, "first");
      if (g_live_step == 0 && worker.health_reason() == "it is tired") {
        g_live_step = 1;
      } else if (g_live_step == 1 && worker.health() == status::HEALTH_OK) {
        g_live_step = 2;
      } else if (g_live_step == 2 && worker.state() == status::STATE_FAILED &&
                 worker.last_fault() == "its serve() threw: it broke") {
        source_.finish();
      }
    });
  }

 private:
  Source source_;
};

TEST(ALiveStatus, TellsOfHealthAndFaults) {
  TestClasses live;
  live.with<Worker>("worker")
      .with<LiveWorker>("live_worker")
      .with<Listener>("listener")
      .with<LiveSupervisor>("supervisor");
  g_live_step = 0;
  const auto application =
      make_application(application_text(
                           R"({"name": "second", "library": "worker", "serve_period_ms": 0.2},
             {"name": "listener", "library": "listener"},
             {"name": "first", "library": "live_worker", "serve_period_ms": 2}, )" +
                               std::string(kSupervisor),
                           R"("status_period_ms": 1, )"),
                       live);
  application->start();
  EXPECT_EQ(application->run(60s), EndReason::kSourcesFinished);
  application->stop();
  EXPECT_TRUE(ledger_of(*application, kStatusTopic, "supervisor").adds_up());
}

/// Says a thousand times in one callback how it is.
class Talker final : public Component {
 public:
  explicit Talker(Context& context) : Component(context) {
    context.create_subscriber<status::Status>(kStatusTopic, [](const status::Status&) {});
  }

  void serve() override {
    for (int i = 0; i < 1000; ++i) {
      health(i % 2 == 0 ? Health::kDegraded : Health::kOk, "reason " + std::to_string(i));
    }
  }
};

TEST(AComponentThatSaysMuch, DoesNotFloodTheStatus) {
  for (const bool is_simulated : {true, false}) {
    TestClasses its_classes;
    its_classes.with<Talker>("talker");
    const auto application = make_application(
        R"({"name": "test", "executors": [{"name": "one"}], "status_period_ms": 86400000,
            "components": [{"name": "talker", "library": "talker", "executor": "one",
                            "serve_period_ms": 10}]})",
        its_classes, {.is_simulated = is_simulated});
    application->start();
    application->run(95ms);
    application->stop();
    ASSERT_EQ(application->components().back()->name, kOwnName);
    const detail::ComponentCore& talker = *application->components().front();
    const detail::ComponentCore& status = *application->components().back();
    EXPECT_GE(talker.statistics.activations.get(), 1U);
    // One report for each call of `serve`, what is reported of the start and the end, and in
    // simulated time an activation of its own for each message.
    EXPECT_LE(status.statistics.activations.get(), 3 * talker.statistics.activations.get() + 20);
    EXPECT_EQ(talker.health_reason, "reason 999");
  }
}

TEST(PendingNewsOfAComponent, AreTheNewestAndUrgentIfAnyWas) {
  PendingNews pending;
  pending.set_count(2);
  EXPECT_TRUE(pending.put({.component = 1, .health_reason = "a", .is_urgent = true}));
  EXPECT_FALSE(pending.put({.component = 1, .health_reason = "b"}));
  EXPECT_TRUE(pending.put({.component = 0, .health_reason = "c"}));
  const ComponentNews news = pending.take(1);
  EXPECT_EQ(news.health_reason, "b");
  EXPECT_TRUE(news.is_urgent);
  EXPECT_TRUE(pending.put({.component = 1, .health_reason = "d"}));
  EXPECT_FALSE(pending.take(1).is_urgent);
}

// --- Recorded and replayed. ---

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> lines;
  std::size_t begin = 0;
  for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n', begin)) {
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

std::string seen_in_replay(const std::filesystem::path& file, const std::string& text,
                           ReplayOptions options, std::string& warnings) {
  config::Problems problems;
  const auto description = describe_text(text, problems);
  options.files = {file};
  const auto replay = prepare_replay(std::move(options), description, classes(), problems);
  for (const config::Problem& problem : problems.all()) {
    warnings += config::to_string(problem) + "\n";
  }
  if (replay == nullptr) {
    return "no replay";
  }
  Application application(replay->description(), {.is_simulated = true, .workers = 2});
  application.replay(*replay);
  application.build(*replay, problems, ConstructorFault::kFault);
  EXPECT_FALSE(problems.has_errors());
  application.start();
  application.run(std::nullopt);
  application.stop();
  for (const auto& component : application.components()) {
    if (component->name == "supervisor") {
      return std::get<std::string>(component->results.at("seen"));
    }
  }
  return "no supervisor";
}

class ARecordedStatus : public ::testing::Test {
 protected:
  /// Records a run, with or without its status.
  void record(const std::string& except) {
    const auto application = std::make_unique<Application>(
        [&] {
          config::Problems problems;
          return describe_text(text_, problems);
        }(),
        ClockOptions{.is_simulated = true, .workers = 1});
    config::RecordDescription record;
    record.file = file_;
    if (!except.empty()) {
      record.except = {except};
    }
    application->record(record);
    config::Problems problems;
    application->build(classes(), problems, ConstructorFault::kFault);
    application->start();
    application->run(3s);
    application->stop();
    for (const auto& component : application->components()) {
      if (component->name == "supervisor") {
        seen_ = std::get<std::string>(component->results.at("seen"));
      }
    }
  }

  config::TestFolder folder_;
  const std::filesystem::path file_ = folder_.path() / "run.mcap";
  const std::string text_ = application_text(
      worker("first", R"("degraded_at": 4, "throws_at": 8)") + worker("second", "") +
      R"({"name": "listener", "library": "listener"}, )" + kSupervisor);
  std::string seen_;
  std::string warnings_;
};

TEST_F(ARecordedStatus, IsWhatAReplayedSupervisorSees) {
  record("");
  EXPECT_EQ(split(seen_in_replay(file_, text_, {.into = {"supervisor"}}, warnings_)), split(seen_));
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(ARecordedStatus, IsMadeAnewIfTheRecordingHasNone) {
  record("fastcycle/status");
  const std::string seen =
      seen_in_replay(file_, text_, {.into = {"first", "listener", "supervisor"}}, warnings_);
  EXPECT_THAT(warnings_, IsEmpty());
  // As it was, but for who is replaced: that one does nothing.
  EXPECT_THAT(seen, HasSubstr("400 "));
  EXPECT_THAT(seen, HasSubstr("health_reason: \"it is tired\""));
  EXPECT_THAT(seen, HasSubstr("last_fault: \"its serve() threw: it broke\""));
  EXPECT_THAT(seen, HasSubstr("name: \"second\" state: STATE_REPLAYED"));
}

}  // namespace
}  // namespace fastcycle::host

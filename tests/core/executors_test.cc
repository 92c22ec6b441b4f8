// Executors as the application file describes them: places, policies, ways of waiting.

#include <atomic>
#include <thread>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/prctl.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle {
namespace {

using google::protobuf::Int64Value;
using host::Application;
using host::EndReason;
using host::TestClasses;
using namespace std::chrono_literals;

/// Sends a message round and round, a hundred times, and says on what thread it ran.
class Player final : public Component {
 public:
  explicit Player(Context& context)
      : Component(context),
        serves_(context.param<bool>("serves", {.fallback = false})),
        ball_(context.create_publisher<Int64Value>("out")) {
    if (serves_.get()) {
      source_.emplace(context.create_source());
    }
    context.create_subscriber<Int64Value>("in", [this](const Int64Value& ball) {
      if (serves_.get() && ball.value() >= 100) {
        source_->finish();
        return;
      }
      hit(ball.value() + 1);
    });
  }

  void start() override {
    char name[16] = {};
    pthread_getname_np(pthread_self(), name, sizeof(name));
    report("thread", std::string(name));
    report("policy", static_cast<std::int64_t>(sched_getscheduler(0)));
    report("slack_ns", static_cast<std::int64_t>(prctl(PR_GET_TIMERSLACK)));
    cpu_set_t cpus;
    sched_getaffinity(0, sizeof(cpus), &cpus);
    report("cpus", static_cast<std::int64_t>(CPU_COUNT(&cpus)));
  }

  void serve() override {
    if (serves_.get() && !has_begun_) {
      has_begun_ = true;
      hit(0);
    }
  }

 private:
  void hit(std::int64_t count) {
    auto ball = ball_.loan();
    ball->set_value(count);
    ball_.publish(std::move(ball));
  }

  Param<bool> serves_;
  Publisher<Int64Value> ball_;
  std::optional<Source> source_;
  bool has_begun_ = false;
};

/// Two players, on the executors that `executors` describes: "a" and "b", or only "a".
std::unique_ptr<Application> play(const std::string& executors, const std::string& second) {
  TestClasses classes;
  classes.with<Player>("player");
  auto application =
      host::make_application(R"({"name": "t", "executors": [)" + executors + R"(], "components": [
        {"name": "one", "library": "player", "executor": "a", "serve_period_ms": 1,
         "params": {"serves": true}, "remap": {"in": "pong", "out": "ping"}},
        {"name": "two", "library": "player", "executor": ")" +
                                 second + R"(",
         "remap": {"in": "ping", "out": "pong"}}]})",
                             classes);
  application->start();
  EXPECT_EQ(application->run(Duration(60s)), EndReason::kSourcesFinished);
  application->stop();
  for (const char* topic : {"ping", "pong"}) {
    const auto& subscription = application->topics().find(topic)->subscriptions.at(0);
    EXPECT_TRUE(subscription->ledger().adds_up());
    EXPECT_EQ(subscription->ledger().queued, 0U);
  }
  return application;
}

const ReportValue& result(const Application& application, const std::string& name) {
  return application.components()[0]->results.at(name);
}

TEST(Executors, EveryWayOfWaitingCarriesMessagesBetweenTwoThreads) {
  for (const std::string wait : {"park", "adaptive", "spin"}) {
    const std::string rest = R"(", "threads": 1, "wait": ")" + wait + "\"}";
    play(R"({"name": "a)" + rest + R"(, {"name": "b)" + rest, "b");
  }
}

TEST(Executors, OneThreadHandsOverToItself) {
  play(R"({"name": "a", "threads": 1})", "a");
}

TEST(Executors, APoolServesItsComponentsWithAndWithoutHandingOver) {
  play(R"({"name": "a", "threads": 4})", "a");
  play(R"({"name": "a", "threads": 4, "hand_over": true})", "a");
}

TEST(Executors, ThreadsHaveTheirNameTheirCpusAndATimerSlackOfOneNanosecond) {
  const auto application = play(R"({"name": "a", "threads": 1, "cpus": [0]})", "a");

  EXPECT_EQ(result(*application, "thread"), ReportValue(std::string("a")));
  EXPECT_EQ(result(*application, "cpus"), ReportValue(std::int64_t{1}));
  EXPECT_EQ(result(*application, "slack_ns"), ReportValue(std::int64_t{1}));
}

TEST(Executors, RealTimePoliciesAreAppliedOrTheRefusalIsReportedAndTheRunGoesOn) {
  for (const auto& [word, policy] : {std::pair{"fifo", SCHED_FIFO}, std::pair{"rr", SCHED_RR}}) {
    const auto application = play(
        std::string(R"({"name": "a", "threads": 1, "policy": ")") + word + R"(", "priority": 10})",
        "a");

    if (application->refusals().empty()) {
      EXPECT_EQ(result(*application, "policy"), ReportValue(std::int64_t{policy}));
    } else {
      EXPECT_NE(application->refusals()[0].what.find(word), std::string::npos);
      EXPECT_NE(application->refusals()[0].remedy.find("rtprio 99"), std::string::npos);
      EXPECT_EQ(result(*application, "policy"), ReportValue(std::int64_t{SCHED_OTHER}));
    }
  }
}

/// A device whose data must be in before simulated time goes on.
class SlowDevice final : public Component {
 public:
  explicit SlowDevice(Context& context)
      : Component(context), readings_(context.create_external_publisher<Int64Value>("readings")) {
    context.create_thread("device", [this, &context](const std::stop_token& stop) {
      const TimeHold hold = context.hold_time();
      is_holding_ = true;
      // While the hold lives, the ticks of this component do not come.
      const auto end = std::chrono::steady_clock::now() + 30ms;
      while (std::chrono::steady_clock::now() < end && !stop.stop_requested()) {
      }
      auto reading = readings_.loan();
      reading->set_value(ticks_);
      readings_.publish(std::move(reading), kSimulatedStart);
    });
    context.create_subscriber<Int64Value>(
        "readings", [this](const Int64Value& reading) { report("ticks", reading.value()); });
  }
  void serve() override {
    if (is_holding_) {
      ++ticks_;
    }
  }

 private:
  ExternalPublisher<Int64Value> readings_;
  std::atomic<bool> is_holding_{false};
  std::atomic<std::int64_t> ticks_{0};
};

TEST(Simulation, TimeStandsWhileAForeignThreadHoldsIt) {
  TestClasses classes;
  classes.with<SlowDevice>("device");
  const auto application = host::make_application(
      R"({"name": "t", "components": [
        {"name": "d", "library": "device", "serve_period_ms": 1}]})",
      classes, {.is_simulated = true});

  application->start();
  // Until the thread has come to its hold time may run; a day is enough for it to come.
  while (!application->components()[0]->results.contains("ticks")) {
    application->advance_to(application->clock().now() + 1s);
  }
  application->stop();

  // At most the tick under way when the hold began.
  EXPECT_LE(std::get<std::int64_t>(result(*application, "ticks")), 1);
}

/// Its thread waits for a device, and is notified of the end only when `stop` closes that.
class BlockingDriver final : public Component {
 public:
  explicit BlockingDriver(Context& context) : Component(context) {
    context.create_thread("device", [this](const std::stop_token&) {
      while (!is_closed_.load()) {
        std::this_thread::yield();
      }
    });
  }
  void stop() override { is_closed_ = true; }

 private:
  std::atomic<bool> is_closed_{false};
};

TEST(ComponentThreads, ThatWaitForADeviceEndWhenStopClosesIt) {
  TestClasses classes;
  classes.with<BlockingDriver>("driver");
  for (const bool is_simulated : {false, true}) {
    const auto application = host::make_application(
        R"({"name": "t", "components": [{"name": "d", "library": "driver"}]})", classes,
        {.is_simulated = is_simulated});

    application->start();
    EXPECT_EQ(application->run(Duration(1ms)), EndReason::kTimeOver);
    application->stop();
  }
}

class WrongDelegator final : public Component {
 public:
  explicit WrongDelegator(Context& context) : Component(context) {}
  void start() override {
    context().offload("polo", [] {}, [] {});
  }
};

TEST(Offload, ToAnExecutorThatDoesNotExistIsAFaultWithTheNearestName) {
  TestClasses classes;
  classes.with<WrongDelegator>("delegator");
  for (const bool is_simulated : {false, true}) {
    const auto application = host::make_application(
        R"({"name": "t", "components": [{"name": "d", "library": "delegator"}]})", classes,
        {.is_simulated = is_simulated});

    application->start();
    application->stop();

    ASSERT_EQ(application->components()[0]->faults.size(), 1U);
    EXPECT_NE(application->components()[0]->faults[0].find("did you mean \"pool\"?"),
              std::string::npos);
  }
}

}  // namespace
}  // namespace fastcycle

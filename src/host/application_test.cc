#include "host/application.h"

#include <array>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <fmt/format.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <sched.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using detail::DropReason;
using detail::Ledger;
using google::protobuf::BytesValue;
using google::protobuf::Int64Value;
using namespace std::chrono_literals;

std::uint64_t dropped(const Ledger& ledger, DropReason reason) {
  return ledger.dropped[static_cast<std::size_t>(reason)];
}

/// Waits until `condition` holds; gives up, and fails the test, after a minute.
template <typename Condition>
void wait_until(const Condition& condition) {
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (!condition()) {
    ASSERT_LT(std::chrono::steady_clock::now(), limit) << "the condition never came true";
    std::this_thread::yield();
  }
}

/// Publishes 1, 2, 3, … on "numbers", one each tick of its Serve Timer, `count` in all.
class Counter final : public Component {
 public:
  explicit Counter(Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count", {.fallback = 10})),
        burst_(context.param<std::int64_t>("burst", {.fallback = 1})),
        numbers_(context.create_publisher<Int64Value>("numbers")),
        source_(context.create_source()) {}

  void serve() override {
    for (std::int64_t i = 0; i < burst_.get() && sent_ < count_.get(); ++i) {
      auto loan = numbers_.loan();
      loan->set_value(++sent_);
      numbers_.publish(std::move(loan));
    }
    if (sent_ >= count_.get()) {
      source_.finish();
    }
  }

 private:
  Param<std::int64_t> count_;
  Param<std::int64_t> burst_;
  Publisher<Int64Value> numbers_;
  Source source_;
  std::int64_t sent_ = 0;
};

/// Sums what it receives, and reports it.
class Adder final : public Component {
 public:
  explicit Adder(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", [this](const Sample<Int64Value>& number) {
      in_order_ = in_order_ && number.info().sequence > last_;
      last_ = number.info().sequence;
      sum_ += number->value();
    });
  }

  void stop() override {
    report("sum", sum_);
    report("in_order", in_order_);
  }

 private:
  std::int64_t sum_ = 0;
  std::uint64_t last_ = 0;
  bool in_order_ = true;
};

constexpr const char* kCountAndAdd = R"({"name": "test", "components": [
  {"name": "counter", "library": "counter", "serve_period_ms": 1, "params": {"count": 50}},
  {"name": "adder", "library": "adder"}]})";

ReportValue result(const Application& application, std::size_t component, const std::string& name) {
  return application.components()[component]->results.at(name);
}

TEST(Application, RunsLiveUntilItsSourcesHaveFinished) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Adder>("adder");
  const auto application = make_application(kCountAndAdd, classes);

  application->start();
  EXPECT_EQ(application->run(std::nullopt), EndReason::kSourcesFinished);
  application->stop();

  EXPECT_EQ(result(*application, 1, "sum"), ReportValue(std::int64_t{50 * 51 / 2}));
  EXPECT_EQ(result(*application, 1, "in_order"), ReportValue(true));
  const Ledger ledger = ledger_of(*application, "numbers", "adder");
  EXPECT_EQ(ledger.published, 50U);
  EXPECT_EQ(ledger.delivered, 50U);
  EXPECT_TRUE(ledger.adds_up());
}

TEST(Application, RunsInSimulatedTimeWithoutWaiting) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Adder>("adder");
  const auto application = make_application(kCountAndAdd, classes, {.is_simulated = true});

  application->start();
  EXPECT_EQ(application->run(std::nullopt), EndReason::kSourcesFinished);
  application->stop();

  EXPECT_EQ(application->end_time(), kSimulatedStart + 50ms);
  EXPECT_EQ(result(*application, 1, "sum"), ReportValue(std::int64_t{50 * 51 / 2}));
}

TEST(Application, TwoOfThemRunInOneProcess) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Adder>("adder");
  const auto first = make_application(kCountAndAdd, classes);
  const auto second = make_application(kCountAndAdd, classes);

  first->start();
  second->start();
  first->run(std::nullopt);
  second->run(std::nullopt);
  first->stop();
  second->stop();

  EXPECT_EQ(result(*first, 1, "sum"), result(*second, 1, "sum"));
}

TEST(Application, ALimitOfTimeEndsTheRun) {
  TestClasses classes;
  classes.with<Adder>("adder");
  const auto text = R"({"name": "t", "components": [{"name": "a", "library": "adder"}]})";
  for (const bool is_simulated : {false, true}) {
    const auto application = make_application(text, classes, {.is_simulated = is_simulated});

    application->start();
    EXPECT_EQ(application->run(Duration(5ms)), EndReason::kTimeOver);
    application->stop();

    EXPECT_GE(application->end_time() - application->start_time(), 5ms);
  }
}

TEST(Application, ARequestInMidRunEndsItInOrderAndTheLedgerAddsUp) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Adder>("adder");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 0.05,
         "params": {"count": 1000000000, "burst": 20}},
        {"name": "adder", "library": "adder", "subscribers": {"numbers": {"depth": 1}}}]})",
      classes);

  application->start();
  wait_until([&] { return ledger_of(*application, "numbers", "adder").delivered > 100; });
  application->request_end(EndReason::kRequested);
  EXPECT_EQ(application->run(std::nullopt), EndReason::kRequested);
  application->stop();

  const Ledger ledger = ledger_of(*application, "numbers", "adder");
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(ledger.queued, 0U);
  EXPECT_GT(dropped(ledger, DropReason::kOverflow), 0U);
}

// ---- Faults ----

enum class Where { kConstructor, kStart, kCallback, kServe, kStop, kDestructor, kNowhere };

/// Throws where its parameter says.
class Faulty final : public Component {
 public:
  explicit Faulty(Context& context)
      : Component(context),
        where_(context.param<Where>("where", {.fallback = Where::kNowhere,
                                              .names = {{"constructor", Where::kConstructor},
                                                        {"start", Where::kStart},
                                                        {"callback", Where::kCallback},
                                                        {"serve", Where::kServe},
                                                        {"stop", Where::kStop},
                                                        {"destructor", Where::kDestructor}}})) {
    context.create_subscriber<Int64Value>("numbers",
                                          [this](const Int64Value&) { fail_at(Where::kCallback); });
    fail_at(Where::kConstructor);
  }
  ~Faulty() noexcept(false) override {
    if (where_.get() == Where::kDestructor) {
      throw std::runtime_error("on purpose");
    }
  }
  void start() override { fail_at(Where::kStart); }
  void serve() override { fail_at(Where::kServe); }
  void stop() override { fail_at(Where::kStop); }

 private:
  void fail_at(Where where) const {
    if (where_.get() == where) {
      throw std::runtime_error("on purpose");
    }
  }

  Param<Where> where_;
};

std::unique_ptr<Application> run_faulty(const std::string& where, const std::string& policy,
                                        const ClockOptions& clock = {}) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Adder>("adder").with<Faulty>("faulty");
  auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 1, "params": {"count": 30}},
        {"name": "faulty", "library": "faulty", "serve_period_ms": 2, "on_fault": ")" +
          policy + R"(", "params": {"where": ")" + where + R"("}},
        {"name": "adder", "library": "adder"}]})",
      classes, clock);
  if (application->end_reason() == EndReason::kNone) {
    application->start();
    application->run(std::nullopt);
  }
  application->stop();
  return application;
}

TEST(Faults, AComponentThatThrowsStopsAndTheOthersRunOn) {
  for (const bool is_simulated : {false, true}) {
    for (const char* where : {"constructor", "start", "callback", "serve", "stop", "destructor"}) {
      const auto application = run_faulty(where, "stop_component", {.is_simulated = is_simulated});

      const auto& faulty = *application->components()[1];
      EXPECT_EQ(application->end_reason(), EndReason::kSourcesFinished) << where;
      EXPECT_EQ(faulty.fault_count, 1U) << where;
      ASSERT_EQ(faulty.faults.size(), 1U) << where;
      EXPECT_NE(faulty.faults[0].find("on purpose"), std::string::npos) << where;
      EXPECT_EQ(result(*application, 2, "sum"), ReportValue(std::int64_t{30 * 31 / 2})) << where;
      EXPECT_TRUE(ledger_of(*application, "numbers", "faulty").adds_up()) << where;
    }
  }
}

TEST(Faults, ThePolicyStopEndsTheRunInOrder) {
  for (const bool is_simulated : {false, true}) {
    for (const char* where : {"constructor", "start", "callback", "serve"}) {
      const auto application = run_faulty(where, "stop", {.is_simulated = is_simulated});

      EXPECT_EQ(application->end_reason(), EndReason::kFault) << where;
      EXPECT_TRUE(ledger_of(*application, "numbers", "adder").adds_up()) << where;
    }
  }
}

TEST(Faults, WhatAFailedComponentMissesIsDroppedForThatReason) {
  const auto application = run_faulty("callback", "stop_component");

  const Ledger ledger = ledger_of(*application, "numbers", "faulty");
  EXPECT_EQ(ledger.delivered, 1U) << "a message whose callback threw was delivered";
  EXPECT_EQ(ledger.published, 30U);
  EXPECT_EQ(dropped(ledger, DropReason::kFault), 29U);
}

TEST(Faults, ARestartedComponentGoesOnAndStaysStoppedWhenItFailsAgainAndAgain) {
  const auto application = run_faulty("callback", "restart", {.is_simulated = true});

  const auto& faulty = *application->components()[1];
  EXPECT_EQ(faulty.restarts, 3U);
  EXPECT_EQ(faulty.fault_count, 4U);
  EXPECT_EQ(faulty.state, detail::ComponentCore::State::kFailed);
  const Ledger ledger = ledger_of(*application, "numbers", "faulty");
  EXPECT_EQ(ledger.delivered, 4U);
  EXPECT_TRUE(ledger.adds_up());
}

/// Fails at its first message ever, then works.
class FailsOnce final : public Component {
 public:
  explicit FailsOnce(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
      if (number.value() == 1) {
        throw std::runtime_error("the first is too much");
      }
      report("last", number.value());
    });
  }
};

TEST(Faults, ARestartedComponentReceivesWhatComesAfter) {
  TestClasses classes;
  classes.with<Counter>("counter").with<FailsOnce>("fails_once");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 1},
        {"name": "f", "library": "fails_once", "on_fault": "restart"}]})",
      classes);

  application->start();
  application->run(std::nullopt);
  application->stop();

  EXPECT_EQ(result(*application, 1, "last"), ReportValue(std::int64_t{10}));
  EXPECT_EQ(ledger_of(*application, "numbers", "f").delivered, 10U);
}

// ---- Timers ----

/// Notes its ticks.
class Ticker final : public Component {
 public:
  explicit Ticker(Context& context) : Component(context) {
    context.create_timer({.period = 10ms, .phase = 3ms}, [this](const Tick& tick) {
      dues.push_back(tick.due - start_time());
      skipped += tick.skipped;
      EXPECT_EQ(now(), tick.due) << "in simulated time nothing is late";
    });
    once_ = context.create_timer([this] {
      shots.push_back(now() - start_time());
      if (shots.size() < 3) {
        once_->arm_at(now() + 7ms);
      }
    });
  }
  void start() override { once_->arm_at(now() + 1ms); }
  void stop() override {
    report("ticks", static_cast<std::int64_t>(dues.size()));
    report("first_ms", static_cast<std::int64_t>(dues.at(0) / 1ms));
    report("last_ms", static_cast<std::int64_t>(dues.back() / 1ms));
    report("shots", static_cast<std::int64_t>(shots.size()));
    report("last_shot_ms", static_cast<std::int64_t>(shots.back() / 1ms));
    report("skipped", static_cast<std::int64_t>(skipped));
  }

 private:
  std::optional<Timer> once_;
  std::vector<Duration> dues;
  std::vector<Duration> shots;
  std::uint64_t skipped = 0;
};

TEST(Timers, FireAtTheirPhaseAndPeriodWithoutDrift) {
  TestClasses classes;
  classes.with<Ticker>("ticker");
  const auto application =
      make_application(R"({"name": "t", "components": [{"name": "t", "library": "ticker"}]})",
                       classes, {.is_simulated = true});

  application->start();
  application->run(Duration(100s));
  application->stop();

  EXPECT_EQ(result(*application, 0, "ticks"), ReportValue(std::int64_t{9'999}));
  EXPECT_EQ(result(*application, 0, "first_ms"), ReportValue(std::int64_t{13}));
  EXPECT_EQ(result(*application, 0, "last_ms"), ReportValue(std::int64_t{99'993}));
  EXPECT_EQ(result(*application, 0, "shots"), ReportValue(std::int64_t{3}));
  EXPECT_EQ(result(*application, 0, "last_shot_ms"), ReportValue(std::int64_t{15}));
  EXPECT_EQ(result(*application, 0, "skipped"), ReportValue(std::int64_t{0}));
}

/// Its first tick takes five periods.
class Slow final : public Component {
 public:
  explicit Slow(Context& context) : Component(context) {}
  void serve() override {
    if (++ticks == 1) {
      const auto end = std::chrono::steady_clock::now() + 55ms;
      while (std::chrono::steady_clock::now() < end) {
      }
    }
  }
  std::atomic<int> ticks{0};
};

TEST(Timers, TicksThatWereMissedAreCountedAsOverrunsAndReplacedByOne) {
  TestClasses classes;
  classes.with<Slow>("slow");
  const auto application = make_application(
      R"({"name": "t", "components": [{"name": "s", "library": "slow", "serve_period_ms": 10}]})",
      classes);

  application->start();
  const auto& component = *application->components()[0];
  // The first tick may itself have come late, instead of earlier ones.
  wait_until([&] { return component.statistics.overruns.get() >= 4; });
  application->stop();
}

TEST(Timers, ManyComponentsInAPoolAllTick) {
  TestClasses classes;
  classes.with<Slow>("slow");
  std::string text = R"({"name": "t", "executors": [{"name": "pool4", "threads": 4}],
                         "components": [)";
  for (int i = 0; i < 100; ++i) {
    text += (i == 0 ? "" : ",") + std::string(R"({"name": "c)") + std::to_string(i) +
            R"(", "library": "slow", "executor": "pool4", "serve_period_ms": 20})";
  }
  const auto application = make_application(text + "]}", classes);

  application->start();
  for (const auto& component : application->components()) {
    auto& slow = static_cast<Slow&>(*component->component);
    wait_until([&] { return slow.ticks >= 3; });
  }
  application->stop();
}

// ---- Views, forwarding, dynamic subscriptions, external threads, jobs ----

class Looker final : public Component {
 public:
  explicit Looker(Context& context)
      : Component(context),
        latest_(context.create_latest<Int64Value>("numbers")),
        history_(context.create_history<Int64Value>("numbers", {.depth = 5})) {}

  void serve() override {
    EXPECT_EQ(latest_.get().get(), latest_.get().get()) << "one answer in one callback";
    if (latest_.get()) {
      report("latest", latest_.get()->value());
      report("age_ms", static_cast<std::int64_t>(*latest_.age() / 1ms));
      report("history", static_cast<std::int64_t>(history_.size()));
      report("oldest", history_[0]->value());
      report("at", history_.at(now() - 3ms)->value());
      report("range", static_cast<std::int64_t>(history_.range(now() - 2ms, now()).size()));
    }
  }

 private:
  Latest<Int64Value> latest_;
  History<Int64Value> history_;
};

TEST(Views, ShowTheNewestAndTheLastMessagesWithoutActivations) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Looker>("looker");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 1},
        {"name": "looker", "library": "looker", "serve_period_ms": 9.5}]})",
      classes, {.is_simulated = true});

  application->start();
  application->run(Duration(9500us));
  application->stop();

  EXPECT_EQ(result(*application, 1, "latest"), ReportValue(std::int64_t{9}));
  EXPECT_EQ(result(*application, 1, "age_ms"), ReportValue(std::int64_t{0}));
  EXPECT_EQ(result(*application, 1, "history"), ReportValue(std::int64_t{5}));
  EXPECT_EQ(result(*application, 1, "oldest"), ReportValue(std::int64_t{5}));
  EXPECT_EQ(result(*application, 1, "at"), ReportValue(std::int64_t{6}));
  EXPECT_EQ(result(*application, 1, "range"), ReportValue(std::int64_t{2}));
  for (const auto& subscription : application->topics().find("numbers")->subscriptions) {
    EXPECT_TRUE(subscription->ledger().adds_up());
  }
}

/// Subscribes at the 10th tick, ends it at the 20th, and so on; a callback ends its own, too.
class Changeable final : public Component {
 public:
  explicit Changeable(Context& context) : Component(context) {}

  void serve() override {
    if (++ticks_ % 20 == 10) {
      subscriber_ = context().create_subscriber<Int64Value>(
          "numbers", [this, count = 0](const Int64Value&) mutable {
            EXPECT_TRUE(subscriber_.has_value()) << "an ended subscription is never called";
            report("calls", ++calls_);
            if (++count == 5 && ticks_ > 100) {
              subscriber_.reset();
            }
          });
    } else if (ticks_ % 20 == 0) {
      subscriber_.reset();
    }
  }

 private:
  std::optional<Subscriber> subscriber_;
  std::int64_t ticks_ = 0;
  std::int64_t calls_ = 0;
};

TEST(Subscriptions, ComeAndGoWhilePublishersRunAndTheLedgerAddsUp) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Changeable>("changeable").with<Adder>("adder");
  for (const bool is_simulated : {true, false}) {
    const auto application = make_application(
        R"({"name": "t", "components": [
          {"name": "counter", "library": "counter", "serve_period_ms": 0.2,
           "params": {"count": 2000}},
          {"name": "changeable", "library": "changeable", "serve_period_ms": 0.5},
          {"name": "adder", "library": "adder"}]})",
        classes, {.is_simulated = is_simulated});

    application->start();
    application->run(std::nullopt);
    application->stop();

    EXPECT_EQ(application->components()[1]->fault_count, 0U);
    EXPECT_GT(std::get<std::int64_t>(result(*application, 1, "calls")), 0);
    const Ledger ledger = ledger_of(*application, "numbers", "changeable");
    EXPECT_TRUE(ledger.adds_up());
    EXPECT_EQ(ledger.queued, 0U);
    EXPECT_LT(ledger.published, 2000U) << "counted only while subscribed";
    EXPECT_EQ(application->topics().find("numbers")->subscriptions.size(), 2U)
        << "one ledger however often it subscribes";
  }
}

/// Receives from a device, that is, from a thread of its own.
class Driver final : public Component {
 public:
  explicit Driver(Context& context)
      : Component(context),
        readings_(context.create_external_publisher<Int64Value>("numbers")),
        source_(context.create_source()) {
    context.create_thread("device", [this](const std::stop_token& stop) {
      for (std::int64_t i = 1; i <= 100 && !stop.stop_requested(); ++i) {
        auto loan = readings_.loan();
        loan->set_value(i);
        readings_.publish(std::move(loan), kSimulatedStart + std::chrono::milliseconds(i));
      }
      source_.finish();
    });
  }

 private:
  ExternalPublisher<Int64Value> readings_;
  Source source_;
};

TEST(ExternalPublishers, CarryMessagesFromForeignThreadsWithTheirTakenTime) {
  class Checker final : public Component {
   public:
    explicit Checker(Context& context) : Component(context) {
      context.create_subscriber<Int64Value>(
          "numbers", {.depth = 200}, [this](const Sample<Int64Value>& number) {
            EXPECT_EQ(number.info().origin.taken,
                      kSimulatedStart + std::chrono::milliseconds(number->value()));
            EXPECT_EQ(number.info().origin.root, number.info().publisher);
            report("count", ++count_);
          });
    }

   private:
    std::int64_t count_ = 0;
  };
  TestClasses classes;
  classes.with<Driver>("driver").with<Checker>("checker");
  for (const bool is_simulated : {false, true}) {
    const auto application = make_application(
        R"({"name": "t", "components": [{"name": "driver", "library": "driver"},
                                        {"name": "checker", "library": "checker"}]})",
        classes, {.is_simulated = is_simulated});

    application->start();
    EXPECT_EQ(application->run(std::nullopt), EndReason::kSourcesFinished);
    application->stop();

    EXPECT_EQ(result(*application, 1, "count"), ReportValue(std::int64_t{100}));
    EXPECT_TRUE(ledger_of(*application, "numbers", "checker").adds_up());
  }
}

/// Says on how many CPUs its thread may run.
class Placed final : public Component {
 public:
  explicit Placed(Context& context) : Component(context), source_(context.create_source()) {
    context.create_thread("device", [this](const std::stop_token& /*stop*/) {
      cpu_set_t cpus;
      CPU_ZERO(&cpus);
      sched_getaffinity(0, sizeof cpus, &cpus);
      cpu_count_ = CPU_COUNT(&cpus);
      is_on_first_ = CPU_ISSET(0, &cpus);
      source_.finish();
    });
  }
  void stop() override {
    report("cpus", std::int64_t{cpu_count_});
    report("is_on_first", is_on_first_);
  }

 private:
  Source source_;
  int cpu_count_ = 0;
  bool is_on_first_ = false;
};

TEST(ThreadsOfComponents, RunWhereTheApplicationSays) {
  TestClasses classes;
  classes.with<Placed>("placed");
  const auto application = make_application(
      R"({"name": "t", "components": [
          {"name": "placed", "library": "placed", "threads": {"device": {"cpus": [0]}}}]})",
      classes, {.is_simulated = false});

  EXPECT_TRUE(application->start().empty());
  EXPECT_EQ(application->run(std::nullopt), EndReason::kSourcesFinished);
  application->stop();

  EXPECT_EQ(result(*application, 0, "cpus"), ReportValue(std::int64_t{1}));
  EXPECT_EQ(result(*application, 0, "is_on_first"), ReportValue(true));
}

TEST(ThreadsOfComponents, WhatTheMachineRefusesIsSaidAndTheyRun) {
  TestClasses classes;
  classes.with<Placed>("placed");
  const auto application = make_application(
      R"({"name": "t", "components": [
          {"name": "placed", "library": "placed", "threads": {"device": {"cpus": [1000]}}}]})",
      classes, {.is_simulated = false});

  EXPECT_EQ(application->start().size(), 1U);
  EXPECT_EQ(application->run(std::nullopt), EndReason::kSourcesFinished);
  application->stop();
}

TEST(ThreadsOfComponents, OneThatNobodyMakesIsAnError) {
  TestClasses classes;
  classes.with<Placed>("placed");
  config::Problems problems;
  Application application(describe_text(R"({"name": "t", "components": [
      {"name": "placed", "library": "placed", "threads": {"devise": {"cpus": [0]}}}]})",
                                        problems),
                          {.is_simulated = true});

  application.build(classes, problems, ConstructorFault::kFault);

  ASSERT_EQ(problems.all().size(), 1U);
  EXPECT_EQ(problems.all()[0].message, "component \"placed\" makes no thread \"devise\"");
  EXPECT_NE(problems.all()[0].hint.find("device"), std::string::npos);
}

/// Lets somebody else do the work.
class Delegator final : public Component {
 public:
  explicit Delegator(Context& context)
      : Component(context), fails_(context.param<bool>("fails", {.fallback = false})) {
    source_.emplace(context.create_source());
  }
  void start() override {
    auto answer = std::make_shared<std::int64_t>(0);
    context().offload(
        "workers",
        [answer, fails = fails_.get()] {
          if (fails) {
            throw std::runtime_error("too heavy");
          }
          *answer = 42;
        },
        [this, answer] {
          report("answer", *answer);
          source_->finish();
        });
  }

 private:
  Param<bool> fails_;
  std::optional<Source> source_;
};

TEST(Offload, ItsResultComesBackAsAnActivationAndItsExceptionIsAFault) {
  TestClasses classes;
  classes.with<Delegator>("delegator");
  for (const bool is_simulated : {false, true}) {
    for (const bool fails : {false, true}) {
      const auto application = make_application(
          std::string(R"({"name": "t", "executors": [{"name": "workers", "threads": 2}],
              "components": [{"name": "d", "library": "delegator", "params": {"fails": )") +
              (fails ? "true" : "false") + "}}]}",
          classes, {.is_simulated = is_simulated});

      application->start();
      EXPECT_EQ(application->run(std::nullopt), EndReason::kSourcesFinished);
      application->stop();

      if (fails) {
        EXPECT_NE(application->components()[0]->faults.at(0).find("too heavy"), std::string::npos);
      } else {
        EXPECT_EQ(result(*application, 0, "answer"), ReportValue(std::int64_t{42}));
      }
    }
  }
}

/// Passes on what it receives, unchanged.
class Relay final : public Component {
 public:
  explicit Relay(Context& context)
      : Component(context), out_(context.create_publisher<Int64Value>("relayed")) {
    context.create_subscriber<Int64Value>(
        "numbers", [this](const Sample<Int64Value>& number) { out_.publish(number); });
  }

 private:
  Publisher<Int64Value> out_;
};

TEST(Origin, IsInheritedFromTheCauseAndHeldByTimers) {
  class Probe final : public Component {
   public:
    explicit Probe(Context& context)
        : Component(context), out_(context.create_publisher<Int64Value>("ticked")) {
      context.create_subscriber<Int64Value>("relayed", [this](const Sample<Int64Value>& number) {
        root_ = number.info().origin.root;
        taken_ = number.info().origin.taken;
        EXPECT_NE(root_, number.info().publisher) << "the root is the counter, not the relay";
        EXPECT_FALSE(number.info().origin.held);
      });
    }
    void serve() override {
      if (root_ != 0) {
        out_.publish(out_.loan());
      }
    }

   private:
    Publisher<Int64Value> out_;
    PublisherId root_ = 0;
    Time taken_{};
  };
  class Judge final : public Component {
   public:
    explicit Judge(Context& context) : Component(context) {
      context.create_subscriber<Int64Value>("ticked", [this](const Sample<Int64Value>& number) {
        EXPECT_TRUE(number.info().origin.held);
        EXPECT_EQ(number.info().origin.root, detail::publisher_id("counter", "numbers"));
        report("age_ms", static_cast<std::int64_t>((now() - number.info().origin.taken) / 1ms));
      });
    }
  };
  TestClasses classes;
  classes.with<Counter>("counter").with<Relay>("relay").with<Probe>("probe").with<Judge>("judge");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 10},
        {"name": "relay", "library": "relay"},
        {"name": "probe", "library": "probe", "serve_period_ms": 14},
        {"name": "judge", "library": "judge"}]})",
      classes, {.is_simulated = true});

  application->start();
  application->run(Duration(15ms));
  application->stop();

  EXPECT_EQ(result(*application, 3, "age_ms"), ReportValue(std::int64_t{4}));
}

// ---- Repeatability ----

/// Mixes what it receives into a number that depends on the order of everything.
class Mixer final : public Component {
 public:
  explicit Mixer(Context& context)
      : Component(context), out_(context.create_publisher<Int64Value>("mixed")) {
    for (const std::string topic : {"a", "b", "c"}) {
      context.create_subscriber<Int64Value>(topic, [this, salt = topic[0]](const Int64Value& in) {
        state_ = state_ * 6364136223846793005ULL + static_cast<std::uint64_t>(in.value()) +
                 static_cast<std::uint64_t>(salt) + random()();
        // Long enough that helpers are worth waking.
        const auto end = std::chrono::steady_clock::now() + 80us;
        while (std::chrono::steady_clock::now() < end) {
        }
        auto loan = out_.loan();
        loan->set_value(static_cast<std::int64_t>(state_));
        out_.publish(std::move(loan));
      });
    }
  }
  void stop() override { report(context().component_name(), static_cast<std::int64_t>(state_)); }

 private:
  Publisher<Int64Value> out_;
  std::uint64_t state_ = 1;
};

TEST(Simulation, GivesTheSameResultWithAnyNumberOfWorkers) {
  TestClasses classes;
  classes.with<Mixer>("mixer").with<Counter>("counter");
  // Six mixers that feed each other forward, and counters that feed all; the depths make it matter
  // what is lost.
  std::string text = R"({"name": "t", "components": [)";
  for (const char* topic : {"a", "mixed-1", "mixed-2"}) {
    std::string name = topic;
    std::replace(name.begin(), name.end(), '-', '_');
    text += R"({"name": "counter_)" + name + R"(", "library": "counter", "serve_period_ms": 1,
               "params": {"count": 40, "burst": 3}, "remap": {"numbers": ")" +
            name + R"("}},)";
  }
  const auto mixed = [](int i) {
    return "mixed" + std::string(i < 0 ? "_" : "") + std::to_string(std::abs(i));
  };
  for (int i = 0; i < 6; ++i) {
    text +=
        (i == 0 ? "" : ",") + std::string(R"({"name": "m)") + std::to_string(i) +
        R"(", "library": "mixer", "remap": {"mixed": ")" + mixed(i) + R"(", "b": ")" +
        mixed(i - 1) + R"(", "c": ")" + mixed(i - 2) +
        R"("}, "subscribers": {"b": {"depth": 2}, "c": {"depth": 1, "overflow": "drop_newest"}}})";
  }
  text += "]}";
  std::vector<std::map<std::string, ReportValue, std::less<>>> results;
  for (const unsigned workers : {1U, 2U, 4U, 4U}) {
    const auto application =
        make_application(text, classes, {.is_simulated = true, .workers = workers});

    application->start();
    application->run(std::nullopt);
    application->stop();

    results.emplace_back();
    for (const auto& component : application->components()) {
      results.back().insert(component->results.begin(), component->results.end());
    }
  }

  EXPECT_EQ(results[0].size(), 6U);
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
  EXPECT_EQ(results[2], results[3]);
}

/// Passes numbers on.
class SlowRelay final : public Component {
 public:
  explicit SlowRelay(Context& context)
      : Component(context), out_(context.create_publisher<Int64Value>("relayed")) {
    context.create_subscriber<Int64Value>("numbers", {.depth = 64}, [this](const Int64Value& in) {
      auto loan = out_.loan();
      loan->set_value(in.value());
      out_.publish(std::move(loan));
    });
  }

 private:
  Publisher<Int64Value> out_;
};

/// When which number came, and when it was published.
class Arrivals final : public Component {
 public:
  explicit Arrivals(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>(
        "relayed", {.depth = 64}, [this](const Sample<Int64Value>& number) {
          const double ms = std::chrono::duration<double, std::milli>(now() - start_time()).count();
          text_ += fmt::format("{}@{}", number->value(), ms);
          text_ += number.info().publish_time == now() ? " " : "! ";
        });
  }
  void stop() override { report("arrivals", text_); }

 private:
  std::string text_;
};

TEST(Simulation, ASimulatedCostDelaysWhatAComponentPublishesAndKeepsItBusy) {
  TestClasses classes;
  classes.with<Counter>("counter").with<SlowRelay>("relay").with<Arrivals>("arrivals");
  for (const unsigned workers : {1U, 4U}) {
    const auto application = make_application(R"({"name": "t", "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 1, "params": {"count": 6}},
        {"name": "relay", "library": "relay", "simulated_cost_ms": 2.5},
        {"name": "arrivals", "library": "arrivals"}]})",
                                              classes, {.is_simulated = true, .workers = workers});

    application->start();
    application->run(std::nullopt);
    application->stop();

    // The first comes at 1 ms and takes until 3.5; the next two have come meanwhile. What is being
    // computed when the run ends is done then, and says when it would have been.
    EXPECT_EQ(result(*application, 2, "arrivals"),
              ReportValue(std::string("1@3.5 2@6 3@6 4@6! 5@6! 6@6! ")));
    const Ledger ledger = ledger_of(*application, "relayed", "arrivals");
    EXPECT_EQ(ledger.delivered, 6U);
    EXPECT_TRUE(ledger.adds_up());
  }
}

/// Answers every message with one to itself.
class Echo final : public Component {
 public:
  explicit Echo(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {
    context.create_subscriber<Int64Value>(
        "numbers", [this](const Int64Value&) { numbers_.publish(numbers_.loan()); });
  }
  void start() override { numbers_.publish(numbers_.loan()); }

 private:
  Publisher<Int64Value> numbers_;
};

TEST(Simulation, ComponentsThatAnswerEachOtherWithoutEndAreReportedAndDoNotHang) {
  TestClasses classes;
  classes.with<Echo>("echo");
  const auto application =
      make_application(R"({"name": "t", "components": [{"name": "e", "library": "echo"}]})",
                       classes, {.is_simulated = true});

  application->start();
  EXPECT_EQ(application->run(Duration(1s)), EndReason::kStuck);
  application->stop();

  EXPECT_TRUE(ledger_of(*application, "numbers", "e").adds_up());
}

}  // namespace
}  // namespace fastcycle::host

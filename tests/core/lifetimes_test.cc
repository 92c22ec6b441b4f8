// What comes and goes while messages move: restarted objects, subscriptions, threads, the end.

#include <atomic>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle {
namespace {

using detail::ComponentCore;
using google::protobuf::Int64Value;
using host::EndReason;
using host::TestClasses;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using namespace std::chrono_literals;

void publish(Publisher<Int64Value>& publisher, std::int64_t value) {
  auto loan = publisher.loan();
  loan->set_value(value);
  publisher.publish(std::move(loan));
}

/// Publishes 1 to 10 on "numbers", one each tick.
class Numbers final : public Component {
 public:
  explicit Numbers(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}

  void serve() override {
    if (sent_ < 10) {
      publish(numbers_, ++sent_);
    }
  }

 private:
  Publisher<Int64Value> numbers_;
  std::int64_t sent_ = 0;
};

/// Publishes 7 on "latched" once, then works 300 us each tick.
class Latcher final : public Component {
 public:
  explicit Latcher(Context& context)
      : Component(context), latched_(context.create_publisher<Int64Value>("latched")) {}

  void start() override { publish(latched_, 7); }
  void serve() override { std::this_thread::sleep_for(300us); }

 private:
  Publisher<Int64Value> latched_;
};

/// Runs `T` as component "c" beside numbers and a latched topic, in simulated time, for 30 ms.
template <typename T>
std::unique_ptr<host::Application> run_simulated(const std::string& configuration,
                                                 unsigned workers = 1) {
  TestClasses classes;
  classes.with<T>("c");
  classes.with<Numbers>("numbers").with<Latcher>("latcher");
  auto application = host::make_application(
      R"({"name": "t", "topics": {"latched": {"latched": 1}}, "components": [
        {"name": "c", "library": "c", "serve_period_ms": 1)" +
          configuration + R"(},
        {"name": "numbers", "library": "numbers", "serve_period_ms": 1},
        {"name": "latcher", "library": "latcher", "serve_period_ms": 1}]})",
      classes, {.is_simulated = true, .workers = workers});
  application->start();
  application->run(30ms);
  application->stop();
  return application;
}

template <typename T>
T result(const host::Application& application, const std::string& name) {
  const auto& results = application.components()[0]->results;
  const auto found = results.find(name);
  return found == results.end() ? T{} : std::get<T>(found->second);
}

// ---- Restarts ----

/// Fails at the third number; holds its subscription by a handle.
class HoldsItsHandle final : public Component {
 public:
  explicit HoldsItsHandle(Context& context)
      : Component(context),
        numbers_(context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
          if (number.value() == 3) {
            throw std::runtime_error("no third one");
          }
          report("last", number.value());
        })) {}

 private:
  Subscriber numbers_;
};

TEST(Restart, ASubscriptionHeldByAHandleReceivesAgain) {
  const auto application = run_simulated<HoldsItsHandle>(R"(, "on_fault": "restart")");

  EXPECT_EQ(application->components()[0]->restart_count, 1U);
  EXPECT_EQ(result<std::int64_t>(*application, "last"), 10);
  EXPECT_TRUE(host::ledger_of(*application, "numbers", "c").adds_up());
}

/// Subscribes in its first tick and fails in its fifth, the first object only.
class SubscribesLate final : public Component {
 public:
  explicit SubscribesLate(Context& context) : Component(context) {
    object_ = result_of(context, "objects") + 1;
    report("objects", object_);
  }

  void serve() override {
    ++ticks_;
    if (object_ == 1 && ticks_ == 1) {
      context().create_subscriber<Int64Value>("numbers",
                                              [this](const Int64Value&) { note("calls"); });
      context().offload("pool", [] {}, [this] { note("jobs"); });
    }
    if (object_ == 1 && ticks_ == 5) {
      context().offload("pool", [] {}, [this] { note("jobs"); });
      throw std::runtime_error("enough");
    }
  }

 private:
  static std::int64_t result_of(Context& context, const std::string& name) {
    const auto& results = context.core().results;
    return results.contains(name) ? std::get<std::int64_t>(results.find(name)->second) : 0;
  }
  void note(const std::string& what) { report(what, result_of(context(), what) + 1); }

  std::int64_t object_ = 0;
  int ticks_ = 0;
};

TEST(Restart, WhatTheOldObjectSubscribedToAndOffloadedDoesNotCallTheNewOne) {
  const auto application = run_simulated<SubscribesLate>(R"(, "on_fault": "restart")");

  EXPECT_EQ(application->components()[0]->restart_count, 1U);
  EXPECT_EQ(result<std::int64_t>(*application, "objects"), 2);
  EXPECT_LT(result<std::int64_t>(*application, "calls"), 6);
  EXPECT_EQ(result<std::int64_t>(*application, "jobs"), 1);
  EXPECT_TRUE(host::ledger_of(*application, "numbers", "c").adds_up());
}

/// Fails at its first number; its thread uses the object until it is stopped.
class FailsWithAThread final : public Component {
 public:
  explicit FailsWithAThread(Context& context)
      : Component(context), out_(context.create_external_publisher<Int64Value>("out")) {
    context.create_thread("device", [this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        auto loan = out_.loan();
        loan->set_value(++count_);
        out_.publish(std::move(loan), kSimulatedStart);
        std::this_thread::yield();
      }
    });
    context.create_subscriber<Int64Value>(
        "numbers", [](const Int64Value&) { throw std::runtime_error("no numbers"); });
  }

 private:
  ExternalPublisher<Int64Value> out_;
  std::int64_t count_ = 0;
};

TEST(Restart, AComponentWhoseThreadsUseItsObjectIsMadeAnewAfterTheyEnded) {
  TestClasses classes;
  classes.with<FailsWithAThread>("c").with<Numbers>("numbers");
  const auto application = host::make_application(
      R"({"name": "t", "components": [
        {"name": "c", "library": "c", "on_fault": "restart"},
        {"name": "numbers", "library": "numbers", "serve_period_ms": 1}]})",
      classes);

  application->start();
  application->run(50ms);
  application->stop();

  const ComponentCore& component = *application->components()[0];
  EXPECT_GE(component.restart_count, 1U);
  EXPECT_THAT(component.faults, Not(Contains(HasSubstr("has not ended"))));
}

// ---- Subscriptions ----

/// Ends its subscription in the callback, and subscribes again, with captures that must stay.
class EndsItself final : public Component {
 public:
  explicit EndsItself(Context& context) : Component(context) { subscribe(context); }

 private:
  void subscribe(Context& context) {
    numbers_.emplace(context.create_subscriber<Int64Value>(
        "numbers", [self = this](const Int64Value& number) { self->on_number(number); }));
    EndsItself* const keep = this;
    other_.emplace(context.create_subscriber<Int64Value>("numbers", [keep](const Int64Value&) {
      keep->other_.reset();
      volatile bool is_same = keep->check_ == 42;
      keep->report("same", static_cast<bool>(is_same));
    }));
  }
  void on_number(const Int64Value&) {}

  std::optional<Subscriber> numbers_;
  std::optional<Subscriber> other_;
  std::int64_t check_ = 42;
};

TEST(Subscriptions, ACallbackThatEndsItselfKeepsItsCaptures) {
  const auto application = run_simulated<EndsItself>("");

  EXPECT_EQ(application->components()[0]->faults, std::vector<std::string>{});
  EXPECT_TRUE(result<bool>(*application, "same"));
}

/// Subscribes to a latched topic and leaves at once.
class LeavesAtOnce final : public Component {
 public:
  explicit LeavesAtOnce(Context& context) : Component(context) {}

  void serve() override {
    Subscriber subscriber = context().create_subscriber<Int64Value>(
        "latched", [this](const Int64Value&) { report("called", true); });
  }
};

TEST(Subscriptions, OneThatEndedBeforeItWasConnectedHoldsNoLatchedMessage) {
  const auto application = run_simulated<LeavesAtOnce>("");

  const auto ledger = host::ledger_of(*application, "latched", "c");
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(ledger.queued, 0U);
  EXPECT_FALSE(result<bool>(*application, "called"));
  EXPECT_LT(application->topics().find("latched")->publishers[0]->allocated(), 100U)
      << "the pool does not grow with every subscription that came and went";
}

/// Subscribes to a latched topic and fails in the same callback.
class FailsWhileSubscribing final : public Component {
 public:
  explicit FailsWhileSubscribing(Context& context) : Component(context) {}

  void serve() override {
    context().create_subscriber<Int64Value>("latched",
                                            [this](const Int64Value&) { report("called", true); });
    throw std::runtime_error("not today");
  }
};

TEST(Subscriptions, NothingIsDeliveredToAComponentThatFailed) {
  const auto application = run_simulated<FailsWhileSubscribing>("");

  const auto ledger = host::ledger_of(*application, "latched", "c");
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(ledger.delivered, 0U);
  EXPECT_FALSE(result<bool>(*application, "called"));
}

/// Subscribes to a latched topic while it serves messages of its own in the next round.
class SubscribesWhileBusy final : public Component {
 public:
  explicit SubscribesWhileBusy(Context& context)
      : Component(context), own_(context.create_publisher<Int64Value>("own")) {
    context.create_subscriber<Int64Value>("own", [this](const Int64Value& number) {
      std::this_thread::sleep_for(3ms);
      note(std::to_string(number.value()));
    });
  }

  void serve() override {
    if (++ticks_ == 25) {
      context().create_subscriber<Int64Value>("latched",
                                              [this](const Int64Value&) { note("latched"); });
      publish(own_, 1);
      publish(own_, 2);
      publish(own_, 3);
    }
    std::this_thread::sleep_for(300us);
  }

 private:
  void note(const std::string& what) {
    seen_ += what + " ";
    report("seen", seen_);
  }

  Publisher<Int64Value> own_;
  std::string seen_;
  int ticks_ = 0;
};

TEST(Subscriptions, LatchedMessagesComeInTheSameRoundWithAnyNumberOfWorkers) {
  std::string first;
  for (const unsigned workers : {1U, 2U, 4U}) {
    const auto application = run_simulated<SubscribesWhileBusy>("", workers);
    const auto seen = result<std::string>(*application, "seen");
    if (workers == 1) {
      first = seen;
    }
    EXPECT_EQ(seen, first) << workers << " workers";
    EXPECT_NE(seen.find("latched"), std::string::npos);
  }
}

// ---- Executors ----

/// Sends itself messages without end, and offloads one job.
class Restless final : public Component {
 public:
  explicit Restless(Context& context)
      : Component(context),
        source_(context.create_source()),
        own_(context.create_publisher<Int64Value>("own")) {
    context.create_subscriber<Int64Value>("own", [this](const Int64Value& number) {
      publish(own_, number.value() + 1);
      if (number.value() == 100) {
        this->context().offload("one", [] {}, [this] { source_.finish(); });
      }
    });
  }
  void start() override { publish(own_, 1); }

 private:
  Source source_;
  Publisher<Int64Value> own_;
};

TEST(Executors, AJobRunsAlsoWhenComponentsAreAlwaysReady) {
  TestClasses classes;
  classes.with<Restless>("restless");
  const auto application = host::make_application(
      R"({"name": "t", "executors": [{"name": "one", "threads": 1}],
          "components": [{"name": "c", "library": "restless", "executor": "one"}]})",
      classes);

  application->start();
  EXPECT_EQ(application->run(5s), EndReason::kSourcesFinished);
  application->stop();
}

/// Publishes as fast as it is served.
class Flood final : public Component {
 public:
  explicit Flood(Context& context)
      : Component(context),
        timer_(context.create_timer([this] {
          for (int i = 0; i < 8; ++i) {
            publish(numbers_, ++sent_);
          }
          timer_.arm_at(now());
        })),
        numbers_(context.create_publisher<Int64Value>("numbers")) {}
  void start() override { timer_.arm_at(now()); }

 private:
  Timer timer_;
  Publisher<Int64Value> numbers_;
  std::int64_t sent_ = 0;
};

/// Ends its subscription in its callback and makes it again, forwards, keeps, throws, is restarted.
class Churn final : public Component {
 public:
  explicit Churn(Context& context)
      : Component(context),
        out_(context.create_publisher<Int64Value>("out")),
        latest_(context.create_latest<Int64Value>("numbers")),
        source_(context.create_source()) {
    static std::atomic<int> objects{0};
    object_ = ++objects % 3;
  }
  void start() override {
    publish(out_, 0);
    subscribe();
  }

 private:
  void subscribe() {
    subscriber_ = this->context().create_subscriber<Int64Value>(
        "numbers", {.depth = 1}, [this](const Sample<Int64Value>& number) {
          const auto newest = latest_.get();
          EXPECT_TRUE(!newest || latest_.age() >= Duration(0));
          kept_ = number;
          subscriber_.reset();
          subscribe();
          out_.publish(number);
          if (++count_ == 100 && object_ != 0) {
            throw std::runtime_error("on purpose");
          }
          if (count_ == 300) {
            source_.finish();
          }
        });
  }

  Publisher<Int64Value> out_;
  Latest<Int64Value> latest_;
  Source source_;
  std::optional<Subscriber> subscriber_;
  Sample<Int64Value> kept_;
  int count_ = 0;
  int object_ = 0;
};

/// Reads what was forwarded, and its origin.
class Sink final : public Component {
 public:
  explicit Sink(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>(
        "out", {.depth = 2}, [this](const Sample<Int64Value>& number) {
          EXPECT_NE(number.info().origin.root, 0U);
          EXPECT_LE(number.info().origin.taken, number.info().publish_time);
          kept_ = number;
        });
  }

 private:
  Sample<Int64Value> kept_;
};

// The sanitizers judge: the lane of a message may be gone when its callback returns, and its
// component may be another object.
TEST(Restart, OfAComponentThatEndsAndMakesItsSubscriptionInEachCallback) {
  for (const std::string threads : {"1", "3"}) {
    TestClasses classes;
    classes.with<Flood>("flood").with<Churn>("churn").with<Sink>("sink");
    const auto application = host::make_application(
        R"({"name": "t", "executors": [{"name": "a", "threads": 1}, {"name": "b", "threads": )" +
            threads + R"(}], "components": [
          {"name": "flood", "library": "flood", "executor": "a"},
          {"name": "churn", "library": "churn", "executor": "b", "on_fault": "restart"},
          {"name": "sink", "library": "sink", "executor": "b"}]})",
        classes);
    application->start();
    EXPECT_EQ(application->run(Duration(20s)), EndReason::kSourcesFinished);
    application->stop();
    for (const char* topic : {"numbers", "out"}) {
      for (const auto& subscription : application->topics().find(topic)->subscriptions) {
        EXPECT_TRUE(subscription->ledger().adds_up()) << topic;
        EXPECT_EQ(subscription->ledger().queued, 0U) << topic;
      }
    }
  }
}

// ---- The end ----

/// Sends itself messages without end, also while the application stops.
class Endless final : public Component {
 public:
  explicit Endless(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {
    context.create_subscriber<Int64Value>("numbers", {.depth = 4}, [this](const Int64Value&) {
      publish(numbers_, 1);
      publish(numbers_, 2);
    });
  }
  void start() override { publish(numbers_, 1); }

 private:
  Publisher<Int64Value> numbers_;
};

/// Counts what calls it after its `stop`.
class StopsEarly final : public Component {
 public:
  explicit StopsEarly(Context& context)
      : Component(context), timer_(context.create_timer([this] { note(); })) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value&) { note(); });
  }
  void stop() override {
    is_stopped_ = true;
    report("late", std::int64_t{0});
    timer_.arm_at(now());
    std::this_thread::sleep_for(2ms);
  }

 private:
  void note() {
    if (is_stopped_) {
      report("late", ++late_);
    }
  }

  Timer timer_;
  bool is_stopped_ = false;
  std::int64_t late_ = 0;
};

TEST(Stop, NothingCallsAComponentAfterItsStop) {
  TestClasses classes;
  classes.with<StopsEarly>("early").with<Endless>("endless");
  const auto application = host::make_application(
      R"({"name": "t", "executors": [{"name": "one", "threads": 1}, {"name": "two", "threads": 1}],
          "components": [{"name": "e", "library": "early", "executor": "one"},
                         {"name": "n", "library": "endless", "executor": "two"}]})",
      classes);

  application->start();
  application->run(20ms);
  application->stop();

  EXPECT_EQ(result<std::int64_t>(*application, "late"), 0);
  EXPECT_TRUE(host::ledger_of(*application, "numbers", "e").adds_up());
  EXPECT_EQ(host::ledger_of(*application, "numbers", "e").queued, 0U);
}

/// A device that says three things and is gone; no source, no timer.
class SaysThree final : public Component {
 public:
  explicit SaysThree(Context& context)
      : Component(context), out_(context.create_external_publisher<Int64Value>("out")) {
    context.create_thread("device", [this](const std::stop_token&) {
      for (int i = 0; i < 3; ++i) {
        out_.publish(out_.loan(), kSimulatedStart);
      }
    });
    context.create_subscriber<Int64Value>(
        "out", [this](const Int64Value&) { report("received", ++received_); });
  }

 private:
  ExternalPublisher<Int64Value> out_;
  std::int64_t received_ = 0;
};

TEST(Stop, ASimulatedRunEndsWhenItsForeignThreadsHaveEnded) {
  TestClasses classes;
  classes.with<SaysThree>("three");
  const auto application =
      host::make_application(R"({"name": "t", "components": [{"name": "c", "library": "three"}]})",
                             classes, {.is_simulated = true});
  std::atomic<bool> has_ended{false};
  std::thread watch([&] {
    for (int i = 0; i < 500 && !has_ended; ++i) {
      std::this_thread::sleep_for(10ms);
    }
    application->request_end(EndReason::kRequested);
  });

  application->start();
  EXPECT_EQ(application->run(std::nullopt), EndReason::kIdle);
  has_ended = true;
  watch.join();
  application->stop();

  EXPECT_EQ(result<std::int64_t>(*application, "received"), 3);
}

class NotesItsStart final : public Component {
 public:
  explicit NotesItsStart(Context& context) : Component(context) {}
  void start() override { report("started", true); }
};

TEST(Stop, ASimulatedRunEndsWhenNothingIsLeftThatCouldHappen) {
  TestClasses classes;
  classes.with<NotesItsStart>("notes");
  const auto application =
      host::make_application(R"({"name": "t", "components": [{"name": "c", "library": "notes"}]})",
                             classes, {.is_simulated = true});

  application->start();
  EXPECT_EQ(application->run(std::nullopt), EndReason::kIdle);
  application->stop();
}

class FailsToStart final : public Component {
 public:
  explicit FailsToStart(Context& context) : Component(context) {}
  void start() override { throw std::runtime_error("no device"); }
};

TEST(Stop, NoComponentStartsAfterOneWhoseFaultEndsTheApplication) {
  TestClasses classes;
  classes.with<FailsToStart>("fails").with<NotesItsStart>("notes");
  for (int i = 0; i < 200; ++i) {
    const auto application = host::make_application(
        R"({"name": "t", "on_fault": "stop",
            "executors": [{"name": "one", "threads": 1}],
            "components": [{"name": "f", "library": "fails", "executor": "one"},
                           {"name": "n", "library": "notes", "executor": "one"}]})",
        classes);
    application->start();
    EXPECT_EQ(application->end_reason(), EndReason::kFault);
    application->stop();
    ASSERT_TRUE(application->components()[1]->results.empty()) << "run " << i;
  }
}

}  // namespace
}  // namespace fastcycle

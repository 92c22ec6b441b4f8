// What ends while something still refers to it: objects after a fault, subscriptions in callbacks,
// timers, and runs in which a component goes on and on. Sanitizers see what a plain build survives.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using namespace std::chrono_literals;

template <typename T>
T& component(const Application& application, std::size_t index) {
  return static_cast<T&>(*application.components()[index]->component);
}

/// False if `condition` does not hold within a minute.
template <typename Condition>
bool wait_for(const Condition& condition) {
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > limit) {
      return false;
    }
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

/// Publishes `burst` numbers on "numbers" at each tick.
class Counter final : public Component {
 public:
  explicit Counter(Context& context)
      : Component(context),
        burst_(context.param<std::int64_t>("burst", {.fallback = 1})),
        numbers_(context.create_publisher<Int64Value>("numbers")) {}
  void serve() override {
    for (std::int64_t i = 0; i < burst_.get(); ++i) {
      auto number = numbers_.loan();
      number->set_value(++count_);
      numbers_.publish(std::move(number));
    }
  }

 private:
  Param<std::int64_t> burst_;
  Publisher<Int64Value> numbers_;
  std::int64_t count_ = 0;
};

/// Throws when it is notified that a message is missing; says which of its objects are called.
class Touchy final : public Component {
 public:
  explicit Touchy(Context& context) : Component(context) {
    ++alive;
    context.create_subscriber<Int64Value>(
        "numbers",
        {.depth = 2, .on_event = [](const QosEvent&) { throw std::runtime_error("not with me"); }},
        [self = std::make_shared<bool>(true), this](const Int64Value&) {
          calls_without_object += alive == 1 && this == the_only ? 0 : 1;
        });
    the_only = this;
  }
  ~Touchy() override {
    --alive;
    the_only = nullptr;
  }

  static inline int alive = 0;
  static inline const Touchy* the_only = nullptr;
  static inline int calls_without_object = 0;
};

TEST(ACallbackForEvents, ThatThrowsEndsWhatWaitsForItsObject) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Touchy>("touchy");
  Touchy::calls_without_object = 0;
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 10, "params": {"burst": 6}},
        {"name": "touchy", "library": "touchy", "on_fault": "restart",
         "restart": {"limit": 100, "back_off_ms": 25}}]})",
      classes, {.is_simulated = true});
  application->start();
  application->run(Duration(500ms));
  EXPECT_GT(application->components()[1]->restart_count, 3U);
  EXPECT_EQ(Touchy::calls_without_object, 0);
  application->stop();
}

/// Calls a service with a deadline, then throws.
class Caller final : public Component {
 public:
  explicit Caller(Context& context)
      : Component(context), client_(context.create_client<Int64Value, Int64Value>("service")) {}
  void serve() override {
    client_.call(client_.loan(), {.deadline = 1s}, [](const Reply<Int64Value>&) {});
    throw std::runtime_error("on purpose");
  }

 private:
  Client<Int64Value, Int64Value> client_;
};

class NeverAnswers final : public Component {
 public:
  explicit NeverAnswers(Context& context) : Component(context) {
    context.create_service<Int64Value, Int64Value>(
        "service", [this](const Int64Value&, Responder<Int64Value> responder) {
          responders_.push_back(std::move(responder));
        });
  }

 private:
  std::vector<Responder<Int64Value>> responders_;
};

TEST(ARunThatStops, WhileACallerWaitsToBeMadeAnewArmsNoTimerOfIt) {
  TestClasses classes;
  classes.with<Caller>("caller").with<NeverAnswers>("server");
  for (const bool is_simulated : {true, false}) {
    const auto application = make_application(
        R"({"name": "t", "components": [
          {"name": "caller", "library": "caller", "serve_period_ms": 1, "on_fault": "restart",
           "restart": {"limit": 100, "back_off_ms": 60000, "back_off_max_ms": 60000}},
          {"name": "server", "library": "server"}]})",
        classes, {.is_simulated = is_simulated});
    application->start();
    if (is_simulated) {
      application->run(Duration(100ms));
    } else {
      ASSERT_TRUE(wait_for([&] {
        return application->components()[0]->state == detail::ComponentCore::State::kRestarting;
      }));
    }
    EXPECT_EQ(application->components()[0]->state, detail::ComponentCore::State::kRestarting);
    application->stop();
  }
}

/// Its callback for "numbers" owns the handle of another subscription, and ends itself.
class Nested final : public Component {
 public:
  explicit Nested(Context& context) : Component(context) {}
  void serve() override {
    auto inner = std::make_shared<std::optional<Subscriber>>(
        context().create_subscriber<Int64Value>("numbers", [](const Int64Value&) {}));
    outer_ = context().create_subscriber<Int64Value>("numbers", [this, inner](const Int64Value&) {
      ++calls;
      outer_.reset();
    });
  }

  int calls = 0;

 private:
  std::optional<Subscriber> outer_;
};

TEST(ASubscription, MayOwnTheHandleOfAnother) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Nested>("nested");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 1},
        {"name": "nested", "library": "nested", "serve_period_ms": 5}]})",
      classes, {.is_simulated = true});
  application->start();
  application->run(Duration(200ms));
  EXPECT_GT(component<Nested>(*application, 1).calls, 10);
  EXPECT_EQ(application->components()[1]->fault_count, 0U);
  application->stop();
}

/// Calls a service that nobody gives, and again in the reply, for ever.
class Insistent final : public Component {
 public:
  explicit Insistent(Context& context)
      : Component(context), client_(context.create_client<Int64Value, Int64Value>("nothing")) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value&) { ++numbers; });
  }
  void activate() override { call(); }
  void serve() override { ++ticks; }

  std::atomic<int> replies{0};
  std::atomic<int> numbers{0};
  std::atomic<int> ticks{0};

 private:
  void call() {
    client_.call(client_.loan(), {}, [this](const Reply<Int64Value>&) {
      ++replies;
      call();
    });
  }
  Client<Int64Value, Int64Value> client_;
};

TEST(AComponent, ThatAnswersItselfWithoutEndKeepsNothingElseFromBeingServed) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Insistent>("insistent");
  const auto application = make_application(
      R"({"name": "t", "executors": [{"name": "one", "threads": 1}], "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 1, "executor": "one"},
        {"name": "insistent", "library": "insistent", "serve_period_ms": 1, "executor": "one"}]})",
      classes);
  application->start();
  const auto& insistent = component<Insistent>(*application, 1);
  EXPECT_TRUE(wait_for([&] {
    return insistent.replies > 1000 && insistent.numbers > 20 && insistent.ticks > 20;
  })) << insistent.replies
      << " replies, " << insistent.numbers << " numbers, " << insistent.ticks << " ticks";
  application->stop();
  EXPECT_TRUE(ledger_of(*application, "numbers", "insistent").adds_up());
}

/// Calls more often in one callback than may wait.
class Flooder final : public Component {
 public:
  explicit Flooder(Context& context)
      : Component(context), client_(context.create_client<Int64Value, Int64Value>("nothing")) {}
  void serve() override {
    for (int i = 0; i < 100'000; ++i) {
      client_.call(client_.loan(), {}, [](const Reply<Int64Value>&) {});
    }
  }

 private:
  Client<Int64Value, Int64Value> client_;
};

TEST(AComponent, ThatCallsWithoutWaitingForRepliesIsAtFaultAndFillsNoMemory) {
  TestClasses classes;
  classes.with<Flooder>("flooder");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "flooder", "library": "flooder", "serve_period_ms": 1}]})",
      classes);
  application->start();
  ASSERT_TRUE(wait_for([&] {
    return application->components()[0]->state == detail::ComponentCore::State::kFailed;
  }));
  application->stop();
  EXPECT_NE(application->components()[0]->faults.at(0).find("flooder"), std::string::npos);
}

/// Throws at every third message.
class Faulty final : public Component {
 public:
  explicit Faulty(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", [](const Int64Value& number) {
      ++calls;
      if (number.value() % 3 == 0) {
        throw std::runtime_error("every third");
      }
    });
  }

  static inline std::atomic<int> calls{0};
};

// A worker that spins serves a message before its publisher has marked it, without a turn; a fault
// suspends the component there.
TEST(AComponent, ThatFailsInASpinningWorkerComesBackEachTime) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Faulty>("faulty");
  const auto application = make_application(
      R"({"name": "t", "executors": [{"name": "spins", "threads": 1, "wait": "adaptive"},
                                     {"name": "other", "threads": 1}], "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 2, "executor": "other"},
        {"name": "faulty", "library": "faulty", "executor": "spins", "on_fault": "restart",
         "restart": {"limit": 1000000, "back_off_ms": 1, "back_off_max_ms": 1}}]})",
      classes);
  Faulty::calls = 0;
  application->start();
  EXPECT_TRUE(wait_for([] { return Faulty::calls > 200; })) << Faulty::calls;
  application->stop();
  EXPECT_GT(application->components()[1]->restart_count, 10U);
}

}  // namespace
}  // namespace fastcycle::host

#include "component/reloading.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "component/component_core.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using detail::ComponentCore;
using detail::ReloadOrder;
using google::protobuf::Int64Value;
using google::protobuf::StringValue;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using namespace std::chrono_literals;

/// How the second version fails.
enum class Failure : std::uint8_t { kNone, kConstructor, kStart, kCallback };

/// Publishes a number every millisecond.
class Numbers final : public Component {
 public:
  explicit Numbers(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}
  void serve() override {
    auto number = numbers_.loan();
    number->set_value(++count_);
    numbers_.publish(std::move(number));
  }

 private:
  Publisher<Int64Value> numbers_;
  std::int64_t count_ = 0;
};

/// Adds up what it receives, in its state, and says which version it is.
template <int version, Failure failure>
class Sum final : public Component {
 public:
  explicit Sum(Context& context)
      : Component(context),
        sum_(context.state<Int64Value>("sum")),
        out_(context.create_publisher<Int64Value>("version")) {
    if (failure == Failure::kConstructor) {
      throw std::runtime_error("constructed on purpose");
    }
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
      sum_->set_value(sum_->value() + number.value());
      auto out = out_.loan();
      out->set_value(version);
      out_.publish(std::move(out));
      if (failure == Failure::kCallback && ++received_ == 15) {
        sum_->set_value(-1);
        throw std::runtime_error("called on purpose");
      }
    });
  }
  void start() override {
    if (failure == Failure::kStart) {
      throw std::runtime_error("started on purpose");
    }
  }
  void stop() override {
    report("sum", sum_->value());
    report("version", std::int64_t{version});
  }

 private:
  State<Int64Value> sum_;
  Publisher<Int64Value> out_;
  int received_ = 0;
};

constexpr const char* kText = R"({"name": "t", "components": [
  {"name": "numbers", "library": "numbers", "serve_period_ms": 1},
  {"name": "sum", "library": "sum"}]})";

template <typename T>
ComponentClass class_of() {
  return {"Sum", &fastcycle::detail::create_component<T>, &fastcycle::detail::destroy_component<T>};
}

/// An application whose second component is replaced now and then.
class AReload : public testing::Test {
 protected:
  AReload() {
    TestClasses classes;
    classes.with<Numbers>("numbers");
    classes.with<Sum<1, Failure::kNone>>("sum");
    application_ = make_application(kText, classes, {.is_simulated = true});
    application_->start();
  }

  ComponentCore& core() { return *application_->components().at(1); }
  void advance(Duration time) {
    now_ += time;
    application_->advance_to(application_->start_time() + now_);
  }

  /// Returns what came of it.
  template <typename T>
  std::string reload(Duration probation = 1s, std::uint32_t misses_forgiven = 2) {
    std::string result = "nobody said";
    const auto order = std::make_shared<ReloadOrder>();
    order->version = {.component_class = class_of<T>(), .library = "new", .build_id = "ab12"};
    order->probation = probation;
    order->misses_forgiven = misses_forgiven;
    order->on_result = [&result](const std::string& why_not) { result = why_not; };
    core().post(
        detail::Cause::kMode, [this, order] { core().versions->reload(order); }, nullptr,
        detail::to_key(detail::LifeStep::kReload));
    advance(5ms);
    order->on_result = nullptr;
    return result;
  }
  std::string obey(detail::LifeStep step) {
    std::string result = "nobody said";
    core().post(
        detail::Cause::kMode, [&] { result = core().obey(step); }, nullptr, detail::to_key(step));
    advance(5ms);
    return result;
  }
  void stop() {
    application_->request_end(EndReason::kRequested);
    application_->stop();
  }

  /// What was received, in all, and that nothing was lost.
  void expect_nothing_lost() {
    const detail::Ledger ledger = ledger_of(*application_, "numbers", "sum");
    EXPECT_TRUE(ledger.adds_up());
    for (const std::uint64_t dropped : ledger.dropped) {
      EXPECT_EQ(dropped, 0U);
    }
    EXPECT_GT(ledger.delivered, 0U);
  }
  std::int64_t result(const std::string& name) {
    return std::get<std::int64_t>(core().results.at(name));
  }
  std::int64_t sum_of_all() {
    const auto count =
        static_cast<std::int64_t>(ledger_of(*application_, "numbers", "sum").delivered);
    return count * (count + 1) / 2;
  }

  std::unique_ptr<Application> application_;
  Duration now_{0};
};

TEST_F(AReload, HandsTheStateOverAndLosesNothing) {
  advance(20ms);
  EXPECT_THAT((reload<Sum<2, Failure::kNone>>()), IsEmpty());
  advance(20ms);
  EXPECT_TRUE(core().versions->is_on_probation());
  EXPECT_EQ(core().versions->news().library, "new");
  EXPECT_EQ(core().versions->news().build_id, "ab12");
  stop();

  EXPECT_EQ(result("version"), 2);
  EXPECT_EQ(result("sum"), sum_of_all());
  EXPECT_EQ(core().renewals(), 0U);
  EXPECT_EQ(core().versions->news().reloads, 1U);
  expect_nothing_lost();
}

TEST_F(AReload, StaysWhenItsProbationIsOver) {
  EXPECT_THAT((reload<Sum<2, Failure::kNone>>(50ms)), IsEmpty());
  EXPECT_TRUE(core().versions->is_on_probation());
  advance(100ms);

  EXPECT_FALSE(core().versions->is_on_probation());
  EXPECT_THAT(core().versions->news().last, HasSubstr("its probation is over"));
  EXPECT_EQ(obey(detail::LifeStep::kRollBack), "it is not on probation");
}

TEST_F(AReload, IsRolledBackAfterAFaultWithTheStateThatWasHandedOver) {
  advance(20ms);
  EXPECT_THAT((reload<Sum<2, Failure::kCallback>>()), IsEmpty());
  advance(20ms);

  EXPECT_EQ(core().state, ComponentCore::State::kActive);
  EXPECT_FALSE(core().versions->is_on_probation());
  EXPECT_EQ(core().fault_count, 1U);
  EXPECT_EQ(core().versions->news().library, "sum");
  EXPECT_EQ(core().versions->news().rollbacks, 1U);
  EXPECT_THAT(core().versions->news().last, HasSubstr("called on purpose"));
  stop();

  EXPECT_EQ(result("version"), 1);
  // Without the fifteen messages that the new version received.
  EXPECT_GT(result("sum"), 0);
  EXPECT_LT(result("sum"), sum_of_all());
  expect_nothing_lost();
}

TEST_F(AReload, IsRolledBackWithThePresentStateWhereAToolAsksForIt) {
  advance(20ms);
  EXPECT_THAT((reload<Sum<2, Failure::kNone>>()), IsEmpty());
  advance(20ms);
  EXPECT_THAT(obey(detail::LifeStep::kRollBack), IsEmpty());
  advance(20ms);
  stop();

  EXPECT_EQ(result("version"), 1);
  EXPECT_EQ(result("sum"), sum_of_all());
  expect_nothing_lost();
}

TEST_F(AReload, IsConfirmedOnRequestAndThenAFaultIsOneAsAnyOther) {
  EXPECT_THAT((reload<Sum<2, Failure::kCallback>>()), IsEmpty());
  EXPECT_THAT(obey(detail::LifeStep::kConfirm), IsEmpty());
  EXPECT_EQ(obey(detail::LifeStep::kConfirm), "it is not on probation");
  advance(20ms);

  EXPECT_EQ(core().versions->news().rollbacks, 0U);
}

TEST_F(AReload, ThatCannotBeMadeLeavesTheOldVersionWithItsState) {
  advance(20ms);
  EXPECT_THAT((reload<Sum<2, Failure::kConstructor>>()), HasSubstr("constructed on purpose"));
  advance(5ms);
  EXPECT_THAT((reload<Sum<2, Failure::kStart>>()), HasSubstr("started on purpose"));
  advance(5ms);
  EXPECT_FALSE(core().versions->is_on_probation());
  stop();

  EXPECT_EQ(result("version"), 1);
  EXPECT_EQ(result("sum"), sum_of_all());
  EXPECT_EQ(core().versions->news().rollbacks, 2U);
  expect_nothing_lost();
}

TEST_F(AReload, IsRefusedWhileAnotherIsOnProbation) {
  EXPECT_THAT((reload<Sum<2, Failure::kNone>>()), IsEmpty());
  EXPECT_THAT((reload<Sum<3, Failure::kNone>>()), HasSubstr("it is on probation"));
}

TEST_F(AReload, IsRolledBackWhenItMissesMoreDeadlinesThanAreForgiven) {
  EXPECT_THAT((reload<Sum<2, Failure::kNone>>(1s, 1)), IsEmpty());
  core().versions->note_miss("that of a test");
  advance(5ms);
  EXPECT_TRUE(core().versions->is_on_probation());
  core().versions->note_miss("that of a test");
  advance(5ms);

  EXPECT_FALSE(core().versions->is_on_probation());
  EXPECT_THAT(core().versions->news().last, HasSubstr("it missed 2 deadlines"));
}

TEST_F(AReload, IsRolledBackAfterACallThatHung) {
  EXPECT_THAT((reload<Sum<2, Failure::kNone>>()), IsEmpty());
  core().versions->note_hang("its callback takes longer than 100 ms");
  advance(5ms);

  EXPECT_FALSE(core().versions->is_on_probation());
  EXPECT_THAT(core().versions->news().last, HasSubstr("takes longer than 100 ms"));
}

TEST_F(AReload, CanBeDoneHundredsOfTimes) {
  for (int i = 0; i < 100; ++i) {
    ASSERT_THAT((reload<Sum<2, Failure::kNone>>()), IsEmpty());
    ASSERT_THAT(obey(detail::LifeStep::kConfirm), IsEmpty());
    ASSERT_THAT((reload<Sum<1, Failure::kNone>>()), IsEmpty());
    ASSERT_THAT(obey(detail::LifeStep::kRollBack), IsEmpty());
  }
  stop();

  EXPECT_EQ(result("version"), 2);
  EXPECT_EQ(result("sum"), sum_of_all());
  EXPECT_EQ(core().versions->news().reloads, 200U);
  EXPECT_EQ(core().versions->news().rollbacks, 100U);
  expect_nothing_lost();
}

/// Says something else than before.
class Different final : public Component {
 public:
  explicit Different(Context& context)
      : Component(context), out_(context.create_publisher<StringValue>("version")) {}

 private:
  Publisher<StringValue> out_;
};

TEST_F(AReload, OfAnotherTypeLeavesTheOldVersion) {
  advance(20ms);
  EXPECT_THAT(reload<Different>(), HasSubstr("as a google.protobuf.StringValue"));
  EXPECT_EQ(core().state, ComponentCore::State::kActive);
  EXPECT_EQ(core().versions->news().library, "sum");
}

// ---- Threads ----

/// Has a thread that ends only a while after it was asked to.
template <int version>
class Threaded final : public Component {
 public:
  explicit Threaded(Context& context) : Component(context), sum_(context.state<Int64Value>("sum")) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
      sum_->set_value(sum_->value() + number.value());
    });
    context.create_thread("slow", [](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        std::this_thread::sleep_for(1ms);
      }
      std::this_thread::sleep_for(60ms);
    });
  }
  void stop() override {
    report("sum", sum_->value());
    report("version", std::int64_t{version});
  }

 private:
  State<Int64Value> sum_;
};

TEST(AReloadOfAComponentWithThreads, LosesNothingWhileTheyEnd) {
  TestClasses classes;
  classes.with<Numbers>("numbers");
  classes.with<Threaded<1>>("sum");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "numbers", "library": "numbers", "serve_period_ms": 1},
        {"name": "sum", "library": "sum", "subscribers": {"numbers": {"depth": 4096}}}]})",
      classes);
  application->start();
  std::thread control([&] { application->run(std::nullopt); });
  ComponentCore& core = *application->components().at(1);

  std::atomic<bool> is_answered{false};
  const auto order = std::make_shared<ReloadOrder>();
  order->version = {.component_class = class_of<Threaded<2>>(), .library = "new", .build_id = {}};
  order->on_result = [&](const std::string& why_not) {
    EXPECT_EQ(why_not, "");
    is_answered = true;
  };
  core.post(detail::Cause::kMode, [&] { core.versions->reload(order); });
  const auto end = std::chrono::steady_clock::now() + 60s;
  while (!is_answered && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(1ms);
  }
  ASSERT_TRUE(is_answered);
  application->request_end(EndReason::kRequested);
  control.join();
  application->stop();

  EXPECT_EQ(core.results.at("version"), ReportValue(std::int64_t{2}));
  const detail::Ledger ledger = ledger_of(*application, "numbers", "sum");
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(detail::DropReason::kInactive)], 0U);
  const auto count = static_cast<std::int64_t>(ledger.delivered);
  EXPECT_EQ(core.results.at("sum"), ReportValue(count * (count + 1) / 2));
}

}  // namespace
}  // namespace fastcycle::host

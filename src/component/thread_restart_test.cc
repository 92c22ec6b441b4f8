#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using detail::ComponentCore;
using google::protobuf::Int64Value;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

constexpr auto kBound = 60s;  // For what must happen: the machine may be busy.

bool await(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + kBound;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) {
      return false;
    }
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

/// What the drivers of one test did.
struct Counters {
  std::atomic<int> made{0};
  std::atomic<int> threads{0};       ///< That run now.
  std::atomic<int> most_threads{0};  ///< That ever ran at once.
  std::atomic<int> stops{0};
  std::atomic<int> destroyed_under_a_thread{0};
  std::atomic<bool> is_throwing{false};
  std::atomic<bool> is_deaf{false};  ///< The thread does not look at its stop_token.
  std::atomic<bool> is_thread_to_throw{false};
};

Counters* counters = nullptr;

/// Its thread says "numbers" which of the objects it belongs to.
class Driver final : public Component {
 public:
  explicit Driver(Context& context)
      : Component(context),
        number_(++counters->made),
        numbers_(context.create_external_publisher<Int64Value>("numbers")) {
    context.create_thread("device", [this](const std::stop_token& stop) { run(stop); });
    context.create_subscriber<Int64Value>(
        "orders", [](const Int64Value&) { throw std::runtime_error("on purpose"); });
  }
  ~Driver() override { counters->destroyed_under_a_thread += counters->threads.load(); }
  void serve() override {
    if (counters->is_throwing.exchange(false)) {
      throw std::runtime_error("on purpose");
    }
  }
  void stop() override { ++counters->stops; }

 private:
  void run(const std::stop_token& stop) {
    const int running = ++counters->threads;
    counters->most_threads = std::max(counters->most_threads.load(), running);
    auto number = numbers_.loan();
    number->set_value(number_);
    numbers_.publish(std::move(number));
    while (!stop.stop_requested() || counters->is_deaf) {
      if (counters->is_thread_to_throw.exchange(false)) {
        --counters->threads;
        throw std::runtime_error("the device is gone");
      }
      std::this_thread::sleep_for(1ms);
    }
    --counters->threads;
  }

  const int number_;
  ExternalPublisher<Int64Value> numbers_;
};

class Neighbour final : public Component {
 public:
  explicit Neighbour(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>(
        "numbers", [this](const Int64Value& number) { newest = number.value(); });
  }
  void serve() override { ++ticks; }

  std::atomic<std::int64_t> newest{0};
  std::atomic<int> ticks{0};
};

constexpr const char* kText = R"({"name": "t", "on_fault": "restart",
  "topics": {"orders": {"external": true}},
  "executors": [{"name": "one", "threads": 1}], "components": [
  {"name": "driver", "library": "driver", "executor": "one", "serve_period_ms": 1},
  {"name": "neighbour", "library": "neighbour", "executor": "one", "serve_period_ms": 1}]})";

class ThreadsOfARestart : public ::testing::Test {
 protected:
  ThreadsOfARestart() {
    counters = &counters_;
    classes_.with<Driver>("driver").with<Neighbour>("neighbour");
  }
  ~ThreadsOfARestart() override { counters = nullptr; }

  void start() {
    application_ = make_application(kText, classes_);
    application_->start();
    ASSERT_TRUE(await([&] { return neighbour().newest == 1; }));
  }
  [[nodiscard]] ComponentCore& driver() { return *application_->components()[0]; }
  [[nodiscard]] Neighbour& neighbour() {
    return static_cast<Neighbour&>(*application_->components()[1]->component);
  }

  Counters counters_;
  TestClasses classes_;
  std::unique_ptr<Application> application_;
};

TEST_F(ThreadsOfARestart, EndBeforeTheObjectGoesAndBeginAgainWithTheNextOne) {
  start();
  counters_.is_throwing = true;

  EXPECT_TRUE(await([&] { return neighbour().newest == 2; }));
  counters_.is_throwing = true;
  EXPECT_TRUE(await([&] { return neighbour().newest == 3; }));
  application_->stop();

  EXPECT_EQ(counters_.made, 3);
  EXPECT_EQ(counters_.most_threads, 1);
  EXPECT_EQ(counters_.threads, 0);
  EXPECT_EQ(counters_.destroyed_under_a_thread, 0);
  EXPECT_EQ(driver().restart_count, 2U);
  EXPECT_EQ(driver().fault_count, 2U);
}

TEST_F(ThreadsOfARestart, MayBeWhatFailed) {
  start();
  counters_.is_thread_to_throw = true;

  EXPECT_TRUE(await([&] { return neighbour().newest == 2; }));
  application_->stop();

  EXPECT_EQ(driver().fault_count, 1U);
  EXPECT_THAT(driver().faults.at(0), HasSubstr("its thread \"device\" threw: the device is gone"));
}

TEST_F(ThreadsOfARestart, ThatDoNotEndKeepItStoppedAndAreNamedWhileOthersGoOn) {
  start();
  counters_.is_deaf = true;
  counters_.is_throwing = true;

  ASSERT_TRUE(await([&] { return driver().state == ComponentCore::State::kRestarting; }));
  const int before = neighbour().ticks;
  EXPECT_TRUE(await([&] { return neighbour().ticks > before + 3; }));
  EXPECT_EQ(driver().state, ComponentCore::State::kRestarting) << "others waited with it";
  EXPECT_TRUE(await([&] { return driver().state == ComponentCore::State::kFailed; }));
  counters_.is_deaf = false;
  application_->stop();

  EXPECT_EQ(counters_.made, 1);
  EXPECT_EQ(counters_.destroyed_under_a_thread, 0);
  EXPECT_THAT(driver().last_fault,
              HasSubstr("its thread \"device\" has not ended within 1 s after its stop_token asked "
                        "for it: it stays stopped"));
}

TEST_F(ThreadsOfARestart, ThatDoNotEndBeforeTheRunDoesAreNamedAndKeepTheirObject) {
  start();
  counters_.is_deaf = true;
  counters_.is_throwing = true;
  ASSERT_TRUE(await([&] { return driver().state == ComponentCore::State::kRestarting; }));

  application_->stop();  // Returns, although the thread does not end.

  ASSERT_EQ(application_->stuck().size(), 1U);
  EXPECT_EQ(application_->stuck()[0].component, "driver");
  EXPECT_EQ(application_->stuck()[0].call, "its thread \"device\"");
  counters_.is_deaf = false;
  application_.reset();
  EXPECT_EQ(counters_.made, 1);
  EXPECT_EQ(counters_.threads, 0);
  EXPECT_EQ(counters_.destroyed_under_a_thread, 0);
}

TEST_F(ThreadsOfARestart, EndBeforeStopWhenItIsMadeAnewInOrder) {
  start();
  std::string why_not = "not asked";
  driver().post(detail::Cause::kMode, [&] { why_not = driver().renew(); });

  EXPECT_TRUE(await([&] { return neighbour().newest == 2; }));
  application_->stop();

  EXPECT_EQ(why_not, "");
  EXPECT_EQ(counters_.stops, 2);
  EXPECT_EQ(counters_.most_threads, 1);
  EXPECT_EQ(driver().fault_count, 0U);
}

TEST_F(ThreadsOfARestart, EndAtOnceInSimulatedTime) {
  fastcycle::testing::Bench bench;
  bench.add<Driver>("driver", R"({"on_fault": "restart"})");
  auto orders = bench.input<Int64Value>("orders");
  auto numbers = bench.output<Int64Value>("numbers");
  bench.start();

  orders.publish({});
  std::int64_t newest = 0;
  EXPECT_TRUE(await([&] {
    bench.advance(1ms);
    for (const Int64Value& number : numbers.take()) {
      newest = number.value();
    }
    return newest == 2;
  }));
  bench.stop();

  EXPECT_EQ(counters_.most_threads, 1);
  EXPECT_EQ(counters_.destroyed_under_a_thread, 0);
}

}  // namespace
}  // namespace fastcycle::host

#include "component/time_driver.h"

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/clock.h"
#include "component/bell.h"
#include "host/live_driver.h"
#include "host/simulated_driver.h"

namespace fastcycle::host {
namespace {

using ::testing::ElementsAre;
using namespace std::chrono_literals;
using detail::LifeStep;

class PlainActor final : public detail::Actor {
 public:
  explicit PlainActor(const base::Clock& its_clock) : Actor("plain", 0, its_clock) {}

 private:
  void on_fault(std::string_view) override {}
};

/// Every driver keeps the same promises.
class ATimeDriver : public ::testing::TestWithParam<bool> {
 protected:
  ATimeDriver() {
    description_.components.emplace_back();
    clock_ = std::make_unique<base::Clock>(GetParam() ? base::Clock::simulated()
                                                      : base::Clock::live(1.0));
    if (GetParam()) {
      driver_ = std::make_unique<SimulatedDriver>(*clock_, 1);
    } else {
      driver_ = std::make_unique<LiveDriver>(*clock_, description_, bell_);
    }
    actor_ = std::make_unique<PlainActor>(*clock_);
    driver_->add(*actor_, description_.components.front());
    driver_->start(refusals_);
  }
  ~ATimeDriver() override {
    driver_->stop([](const detail::Actor&) { return false; });
    // A worker that is on its way out of offloaded work is left alone by stop().
    driver_->join();
  }

  bool is_over(const ControlCall& call) {
    return bell_.wait(base::kNever, [&] { return call.is_over(); });
  }

  config::ApplicationDescription description_;
  Bell bell_;
  std::unique_ptr<base::Clock> clock_;
  std::unique_ptr<TimeDriver> driver_;
  std::unique_ptr<PlainActor> actor_;
  std::vector<base::Refusal> refusals_;
};

TEST_P(ATimeDriver, CallsAnActorAndSaysWhenThatIsOver) {
  int calls = 0;
  EXPECT_TRUE(is_over(driver_->call(*actor_, LifeStep::kOther, [&] { ++calls; })));
  EXPECT_TRUE(is_over(driver_->call(*actor_, LifeStep::kOther, [&] {
    ++calls;
    throw 1;
  })));
  EXPECT_EQ(calls, 2);
  EXPECT_FALSE(driver_->rings().empty());
}

TEST_P(ATimeDriver, StagesWhatMustWaitForTheEndOfARound) {
  std::string order;
  EXPECT_TRUE(is_over(driver_->call(*actor_, LifeStep::kOther, [&] {
    driver_->stage(*actor_, [&] { order += "staged "; });
    order += "called ";
  })));
  EXPECT_EQ(order, driver_->is_simulated() ? "called staged " : "staged called ");
}

TEST_P(ATimeDriver, DoesOffloadedWork) {
  std::atomic<bool> is_done{false};
  EXPECT_TRUE(is_over(driver_->call(*actor_, LifeStep::kOther, [&] {
    EXPECT_TRUE(driver_->submit(0, *actor_, [&] {
      is_done = true;
      bell_.ring();
    }));
  })));
  EXPECT_TRUE(bell_.wait(base::kNever, [&] { return is_done.load(); }));
}

TEST_P(ATimeDriver, EndsARunWhenItIsInterruptedOrTimeIsOver) {
  EXPECT_EQ(driver_->run(clock_->now() + 1ms, Time::max()), TimeDriver::End::kReached);
  if (driver_->is_simulated()) {
    EXPECT_EQ(driver_->run(Time::max(), Time::max()), TimeDriver::End::kIdle);
    EXPECT_EQ(driver_->run(Time::max(), clock_->now() + 1ms), TimeDriver::End::kInputOver);
  } else {
    const std::jthread somebody([this] { driver_->interrupt(); });
    EXPECT_EQ(driver_->run(Time::max(), Time::max()), TimeDriver::End::kInterrupted);
  }
}

INSTANTIATE_TEST_SUITE_P(Live, ATimeDriver, ::testing::Values(false));
INSTANTIATE_TEST_SUITE_P(Simulated, ATimeDriver, ::testing::Values(true));

TEST(ALiveDriver, LeavesAWorkerAloneThatDoesNotComeBack) {
  config::ApplicationDescription description;
  description.components.emplace_back();
  const base::Clock clock = base::Clock::live(1.0);
  Bell bell;
  LiveDriver driver(clock, description, bell);
  PlainActor actor(clock);
  driver.add(actor, description.components.front());
  std::vector<base::Refusal> refusals;
  driver.start(refusals);
  std::atomic<bool> may_go{false};
  std::atomic<bool> has_begun{false};
  const ControlCall call = driver.call(actor, LifeStep::kOther, [&] {
    has_begun = true;
    bell.ring();
    while (!may_go) {
      std::this_thread::sleep_for(1ms);
    }
  });
  EXPECT_TRUE(bell.wait(base::kNever, [&] { return has_begun.load(); }));
  driver.stop([](const detail::Actor&) { return true; });
  EXPECT_TRUE(driver.may_serve(actor));
  EXPECT_FALSE(call.is_over());
  may_go = true;
  driver.join();
  EXPECT_FALSE(driver.may_serve(actor));
  EXPECT_TRUE(call.is_over());
}

TEST(TheExecutorsOfAnApplication, HaveAPoolIfAComponentNamesNone) {
  config::ApplicationDescription description;
  description.executors.emplace_back().name = "control";
  description.components.emplace_back().executor = "control";
  EXPECT_THAT(executor_names(description), ElementsAre("control"));
  description.components.emplace_back();
  EXPECT_THAT(executor_names(description), ElementsAre("control", "pool"));
}

}  // namespace
}  // namespace fastcycle::host

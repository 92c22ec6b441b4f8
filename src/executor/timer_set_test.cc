#include "executor/timer_set.h"

#include <chrono>

#include <gtest/gtest.h>

#include "executor/actor.h"

namespace fastcycle::detail {
namespace {

using namespace std::chrono_literals;

class SilentActor final : public Actor {
 public:
  using Actor::Actor;

 private:
  void on_fault(std::string_view) override {}
};

class TimerSetTest : public ::testing::Test {
 protected:
  TimerCore& add(Duration period, Duration phase = {}) {
    return timers_.add(actor_, {.period = period, .phase = phase}, [](const Tick&) {}, {});
  }
  [[nodiscard]] static std::int64_t ns(Duration time) {
    return base::to_ns(kSimulatedStart + time);
  }

  base::Clock clock_ = base::Clock::simulated();
  SilentActor actor_{"actor", 0, clock_};
  TimerSet timers_{clock_};
};

TEST_F(TimerSetTest, HasTheTimerThatIsDueFirst) {
  TimerCore& slow = add(30ms);
  TimerCore& quick = add(10ms);
  timers_.start(kSimulatedStart);
  timers_.begin_turn();
  EXPECT_EQ(timers_.due(ns(9ms)), nullptr);
  EXPECT_EQ(timers_.due(ns(10ms)), &quick);
  EXPECT_EQ(timers_.due(ns(40ms)), &quick);
  static_cast<void>(timers_.take(quick, ns(40ms)));
  EXPECT_EQ(timers_.due(ns(40ms)), &slow);
}

TEST_F(TimerSetTest, CountsTheTicksThatALateOneStandsFor) {
  TimerCore& timer = add(10ms, 2ms);
  timers_.start(kSimulatedStart);
  const Tick tick = timers_.take(timer, ns(45ms));
  EXPECT_EQ(tick.skipped, 3U);
  EXPECT_EQ(tick.due, kSimulatedStart + 42ms);
  EXPECT_EQ(timers_.next_due_ns(), ns(52ms));
}

TEST_F(TimerSetTest, FiresATimerOnceInATurnOfSimulatedTime) {
  TimerCore& timer = add({});
  timers_.begin_turn();
  timers_.arm(timer, ns(0ms));
  EXPECT_EQ(timers_.due(ns(0ms)), nullptr);
  timers_.begin_turn();
  EXPECT_EQ(timers_.due(ns(0ms)), &timer);
}

TEST_F(TimerSetTest, IsSilentOnceCancelledAndGoesOnWhenStarted) {
  add(10ms);
  timers_.start(kSimulatedStart);
  timers_.cancel();
  EXPECT_EQ(timers_.next_due_ns(), base::kNever);
  timers_.start(kSimulatedStart + 100ms);
  EXPECT_EQ(timers_.next_due_ns(), ns(110ms));
}

TEST_F(TimerSetTest, KeepsItsStatisticsWhenItsTimersAreMadeAnew) {
  const TimerStatistics* before = add(10ms).statistics;
  timers_.clear();
  EXPECT_TRUE(timers_.is_empty());
  EXPECT_EQ(add(10ms).statistics, before);
  EXPECT_EQ(timers_.statistics().size(), 1U);
}

}  // namespace
}  // namespace fastcycle::detail

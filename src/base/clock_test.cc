#include "base/clock.h"

#include <gtest/gtest.h>

namespace fastcycle::base {
namespace {

using namespace std::chrono_literals;

TEST(Clock, LiveTimeNeverGoesBackAndBeginsAtUnixTime) {
  const auto unix_time = std::chrono::system_clock::now();
  const Clock clock = Clock::live();

  Time last = clock.now();
  EXPECT_LT(std::chrono::abs(last - unix_time), 10s);

  for (int i = 0; i < 10'000; ++i) {
    const Time now = clock.now();
    ASSERT_GE(now, last);
    last = now;
  }
}

TEST(Clock, AFasterClockCoversMoreTimeThanTheMachines) {
  const Clock clock = Clock::live(50.0);
  const std::int64_t begin = monotonic_ns();
  const Time first = clock.now();

  while (monotonic_ns() - begin < 2'000'000) {
  }

  EXPECT_GE(clock.now() - first, 90ms);
}

TEST(Clock, MonotonicTimeOfAFutureMomentIsReachedWhenTheClockShowsIt) {
  for (const double rate : {1.0, 50.0, 0.1}) {
    const Clock clock = Clock::live(rate);
    const Time due = clock.now() + std::chrono::duration_cast<Duration>(2ms * rate);

    while (monotonic_ns() < clock.monotonic_at(due)) {
    }

    EXPECT_GE(clock.now(), due) << "rate " << rate;
  }
}

TEST(Clock, RestartedItGoesOnFromThere) {
  const Time begin{5s};
  Clock live = Clock::live();
  live.restart(begin);
  EXPECT_GE(live.now(), begin);
  EXPECT_LT(live.now(), begin + 1h);
  EXPECT_LE(live.monotonic_at(begin), monotonic_ns());

  Clock simulated = Clock::simulated();
  simulated.restart(begin);
  EXPECT_EQ(simulated.now(), begin);
}

TEST(Clock, ALiveClockStandsUntilItIsResumed) {
  const Time begin{5s};
  Clock clock = Clock::live(2.0);
  clock.stand_at(begin);
  const std::int64_t before = monotonic_ns();
  while (monotonic_ns() - before < 2'000'000) {
  }
  EXPECT_EQ(clock.now(), begin);
  EXPECT_GE(clock.monotonic_at(begin + 2s), monotonic_ns() + 900'000'000);

  clock.go_on_at(before);

  EXPECT_FALSE(clock.stands());
  EXPECT_EQ(clock.at_monotonic(before), begin);
  EXPECT_EQ(clock.at_monotonic(before + 1'000'000'000), begin + 2s);
  EXPECT_GE(clock.now(), begin + 4ms);
}

TEST(Clock, SimulatedTimeStandsUntilItIsMoved) {
  Clock clock = Clock::simulated();
  EXPECT_EQ(clock.now(), kSimulatedStart);

  clock.set_simulated(kSimulatedStart + 5ms);

  EXPECT_EQ(clock.now(), kSimulatedStart + 5ms);
}

}  // namespace
}  // namespace fastcycle::base

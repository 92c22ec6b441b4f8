#include "base/cycle_clock.h"

#include <chrono>
#include <cstdint>

#include <gtest/gtest.h>

#include "base/clock.h"

namespace fastcycle::base {
namespace {

/// A counter of 2.5 cycles a nanosecond and a system clock, both of which the test moves.
struct Machine {
  static std::uint64_t cycles() { return static_cast<std::uint64_t>(counter); }
  static std::int64_t ns() {
    ++reads;
    const std::int64_t read_ns = system_ns;
    pass(interruption_ns);
    return read_ns;
  }
  static void pass(std::int64_t ns) {
    system_ns += ns;
    counter += static_cast<double>(ns) * rate;
  }

  static inline double counter = 0.0;
  static inline std::int64_t system_ns = 0;
  static inline std::int64_t interruption_ns = 0;
  static inline double rate = 2.5;
  static inline int reads = 0;
};

class ACycleClock : public testing::Test {
 protected:
  ACycleClock() {
    Machine::counter = 1e13;
    Machine::system_ns = 5'000'000'000;
    Machine::interruption_ns = 0;
    Machine::rate = 2.5;
    Machine::reads = 0;
  }

  /// Reads it once in `step_ns`, for `length_ns`. Returns how often it read the system clock.
  int run(std::int64_t length_ns, std::int64_t step_ns = 1'000) {
    const int before = Machine::reads;
    for (const std::int64_t end = Machine::system_ns + length_ns; Machine::system_ns < end;) {
      Machine::pass(step_ns);
      const std::int64_t now_ns = clock_.now_ns();
      EXPECT_GE(now_ns, last_ns_);
      EXPECT_NEAR(static_cast<double>(now_ns - Machine::system_ns), 0.0, bound_ns_);
      last_ns_ = now_ns;
    }
    return Machine::reads - before;
  }

  CycleClock<Machine> clock_;
  std::int64_t last_ns_ = 0;
  double bound_ns_ = 2.0;
};

TEST_F(ACycleClock, ReadsTheSystemClockOnceInASpanWhenItKnowsTheRate) {
  EXPECT_EQ(run(20'000'000), 20'000);
  EXPECT_LE(run(100'000'000), 1'100);
}

TEST_F(ACycleClock, ReadsTheSystemClockEachTimeWhenItIsReadSeldom) {
  EXPECT_EQ(run(1'000'000'000, 200'000), 5'000);
  EXPECT_EQ(run(20'000'000'000, 2'000'000'000), 10);
}

TEST_F(ACycleClock, FollowsASystemClockThatIsSlewed) {
  run(50'000'000);
  bound_ns_ = 102.0;  // A span of 0.1 ms, at 1000 ppm from one rate to the other.
  Machine::rate = 2.5 * 1.0005;
  EXPECT_LE(run(100'000'000), 1'100);
  Machine::rate = 2.5 * 0.9995;
  EXPECT_LE(run(100'000'000), 1'200);
}

TEST_F(ACycleClock, DoesNotGetAheadOfASystemClockThatIsSlowedDown) {
  bound_ns_ = 52.0;  // A span at 500 ppm.
  run(50'000'000, 50);
  Machine::rate = 2.5 * 1.0005;
  run(30'000'000, 50);
  bound_ns_ = 2.0;
  run(10'000'000, 50);
}

TEST_F(ACycleClock, IsTheSystemClockAsLongAsTheRateChanges) {
  run(50'000'000);
  bound_ns_ = 30'000.0;  // Until it is seen: a third of a span.
  Machine::rate = 3.25;
  run(10'200'000);
  bound_ns_ = 2.0;
  EXPECT_GT(run(5'000'000), 4'900);
  run(30'000'000);
  EXPECT_LE(run(100'000'000), 1'100) << "steady again";
}

TEST_F(ACycleClock, IsRightAfterACounterThatWasSet) {
  for (const double cycles : {-1e11, -1e6, 1e11}) {
    run(50'000'000);
    Machine::counter += cycles;
    run(50'000'000);
  }
}

TEST_F(ACycleClock, IsRightAfterASuspensionInWhichOnlyTheCounterRan) {
  run(50'000'000);
  Machine::counter += 9e12;  // An hour.
  run(50'000'000);
  EXPECT_LE(run(100'000'000), 1'100);
}

TEST_F(ACycleClock, DoesNotUseAReadingThatWasInterrupted) {
  run(50'000'000);
  Machine::interruption_ns = 1'000;  // The reading has no exact place among the counter's.
  bound_ns_ = 1'002.0;
  run(1'000'000);
  EXPECT_EQ(run(1'000'000), 500) << "each time";
  Machine::interruption_ns = 0;
  run(1'000'000);
  bound_ns_ = 2.0;
  EXPECT_LE(run(100'000'000), 2'500);
}

TEST(MonotonicTime, IsThatOfTheSystemClock) {
  using std::chrono::steady_clock;  // CLOCK_MONOTONIC.
  const auto system_ns = [] {
    return std::chrono::nanoseconds(steady_clock::now().time_since_epoch()).count();
  };
  const std::int64_t end_ns = system_ns() + 200'000'000;
  for (std::int64_t last_ns = 0; last_ns < end_ns;) {
    const std::int64_t before_ns = system_ns();
    std::int64_t now_ns = 0;
    for (int i = 0; i < 100; ++i) {
      now_ns = monotonic_ns();
      ASSERT_GE(now_ns, last_ns);
      last_ns = now_ns;
    }
    ASSERT_GE(now_ns, before_ns - 1'000);
    ASSERT_LE(now_ns, system_ns() + 1'000);
  }
}

}  // namespace
}  // namespace fastcycle::base

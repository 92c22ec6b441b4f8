#include "receiver_clock.h"

#include <limits>

#include <gtest/gtest.h>

namespace rav4 {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""us;

constexpr double kUtc_ms = 1.5e12;

TEST(ReceiverClock, EvenFixesAreNeverLate) {
  ReceiverClock clock;

  for (int fix = 0; fix < 500; ++fix) {
    const auto lateness = clock.lateness(205ms + fix * 100ms, kUtc_ms + fix * 100.0);
    EXPECT_LT(std::chrono::abs(lateness), 1us);
  }
}

TEST(ReceiverClock, LateFixIsLateByThatMuch) {
  ReceiverClock clock;
  for (int fix = 0; fix < 200; ++fix) {
    (void)clock.lateness(fix * 100ms, kUtc_ms + fix * 100.0);
  }

  const auto lateness = clock.lateness(20'030ms, kUtc_ms + 20'000.0);

  EXPECT_GT(lateness, 29ms);
  EXPECT_LT(lateness, 31ms);
}

TEST(ReceiverClock, StepOfTheReceiversClockBeginsAnew) {
  ReceiverClock clock;
  (void)clock.lateness(0ms, kUtc_ms);

  EXPECT_EQ(clock.lateness(100ms, kUtc_ms + 18'100.0), 0ms);
  EXPECT_EQ(clock.lateness(200ms, kUtc_ms + 18'200.0), 0ms);
}

TEST(ReceiverClock, FixWithoutTimeStampIsNotLate) {
  ReceiverClock clock;

  EXPECT_EQ(clock.lateness(100ms, std::numeric_limits<double>::quiet_NaN()), 0ms);
}

}  // namespace
}  // namespace rav4

#include "host/pace.h"

#include <chrono>

#include <gtest/gtest.h>

#include "base/clock.h"

namespace fastcycle::host {
namespace {

using namespace std::chrono_literals;

constexpr Time kBegin = kSimulatedStart;

TEST(WallPace, GoesAsFastAsItsRateSays) {
  for (const double rate : {0.5, 1.0, 4.0}) {
    WallPace pace(rate);
    const std::int64_t before_ns = base::monotonic_ns();
    pace.begin(kBegin);
    const std::int64_t after_ns = base::monotonic_ns();

    const std::int64_t at_ns = pace.may_go_at(kBegin + 2s);

    const auto ahead_ns = static_cast<std::int64_t>(2e9 / rate);
    EXPECT_GE(at_ns, before_ns + ahead_ns) << rate;
    EXPECT_LE(at_ns, after_ns + ahead_ns) << rate;
  }
}

TEST(WallPace, StandsWhilePausedAndGoesOnFromThere) {
  WallPace pace(1.0);
  pace.begin(kBegin);
  int changes = 0;
  pace.on_change = [&] { ++changes; };

  pace.set_paused(true);
  EXPECT_EQ(pace.may_go_at(kBegin + 1s), base::kNever);
  pace.goes(kBegin + 1s, true);
  const std::int64_t before_ns = base::monotonic_ns();
  pace.set_paused(false);

  EXPECT_GE(pace.may_go_at(kBegin + 3s), before_ns + 2'000'000'000);
  EXPECT_EQ(changes, 2);
}

TEST(WallPace, AStepGoesToTheNextInput) {
  WallPace pace(1.0);
  pace.begin(kBegin);
  pace.step();
  EXPECT_TRUE(pace.is_paused());
  EXPECT_LE(pace.may_go_at(kBegin + 1s), base::monotonic_ns());
  pace.goes(kBegin + 1s, false);  // A timer on the way.
  EXPECT_LE(pace.may_go_at(kBegin + 2s), base::monotonic_ns());
  pace.goes(kBegin + 2s, true);

  EXPECT_EQ(pace.may_go_at(kBegin + 3s), base::kNever);
}

TEST(WallPace, ALongTimeIsNoOverflow) {
  WallPace pace(1e-3);
  pace.begin(kBegin);
  EXPECT_GT(pace.may_go_at(Time::max()), base::monotonic_ns());
}

}  // namespace
}  // namespace fastcycle::host

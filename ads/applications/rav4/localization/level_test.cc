#include "level.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace rav4 {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

TEST(Level, DeviceCountsAsLevelAtFirst) {
  const Level level(5.0);

  EXPECT_EQ(level.yaw_rate({0.1, 0.2, -0.3}), 0.3);
}

TEST(Level, TiltedDeviceTurnsAboutTheVertical) {
  Level level(5.0);
  const double tilt_rad = 0.3;  // Its nose points down.
  level.on_acceleration(0ms, {9.81 * std::sin(tilt_rad), 0.0, -9.81 * std::cos(tilt_rad)});

  EXPECT_NEAR(level.yaw_rate({std::sin(tilt_rad), 0.0, -std::cos(tilt_rad)}), 1.0, 1e-12);
}

TEST(Level, BrakingIsAveragedOut) {
  Level level(5.0);
  for (int step = 0; step < 5000; ++step) {
    level.on_acceleration(step * 10ms, {step % 2 == 0 ? 3.0 : -3.0, 0.0, -9.81});
  }

  EXPECT_NEAR(level.yaw_rate({1.0, 0.0, 0.0}), 0.0, 0.01);
}

TEST(Level, FreeFallAndBadNumbersSayNothing) {
  Level level(5.0);
  level.on_acceleration(0s, {0.0, 0.0, 0.0});
  level.on_acceleration(1s, {std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0});

  EXPECT_EQ(level.yaw_rate({0.0, 0.0, -0.5}), 0.5);
}

}  // namespace
}  // namespace rav4

#include "speed_filter.h"

#include <random>

#include <gtest/gtest.h>

namespace ads {
namespace {

using std::chrono_literals::operator""ms;

// A vehicle that speeds up, and its sensors each 10 ms.
class SpeedFilterTest : public ::testing::Test {
 protected:
  void drive(int steps) {
    for (int step = 0; step < steps; ++step) {
      time_ += 10ms;
      speed_mps_ += 0.01 * acceleration_mps2_;
      filter_.on_acceleration(time_, acceleration_mps2_ + bias_mps2_ + 0.67 * normal_(random_));
      filter_.on_wheel_speed(time_, speed_mps_ + 0.02 * normal_(random_));
    }
  }

  double speed_mps_ = 10.0;
  double acceleration_mps2_ = 0.0;
  double bias_mps2_ = 0.0;
  std::chrono::nanoseconds time_{};
  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_;
  SpeedFilter filter_{SpeedFilterConfig{}};
};

TEST_F(SpeedFilterTest, SpeedAndAccelerationAreFound) {
  drive(300);
  acceleration_mps2_ = 1.5;
  drive(200);

  EXPECT_NEAR(filter_.speed_mps(), speed_mps_, 0.03);
  EXPECT_NEAR(filter_.acceleration_mps2(), 1.5, 0.4);
}

TEST_F(SpeedFilterTest, OffsetOfTheAccelerometerDoesNotMakeItFaster) {
  bias_mps2_ = 0.2;
  drive(3000);

  EXPECT_NEAR(filter_.speed_mps(), speed_mps_, 0.03);
  EXPECT_NEAR(filter_.acceleration_mps2(), 0.0, 0.4);
}

TEST_F(SpeedFilterTest, AfterAGapItBelievesTheWheels) {
  drive(300);
  time_ += 5000ms;
  speed_mps_ = 2.0;
  drive(5);

  EXPECT_NEAR(filter_.speed_mps(), 2.0, 0.1);
}

TEST_F(SpeedFilterTest, TimeThatGoesBackDoesNoHarm) {
  drive(300);
  filter_.on_wheel_speed(0ms, speed_mps_);

  EXPECT_NEAR(filter_.speed_mps(), speed_mps_, 0.03);
}

}  // namespace
}  // namespace ads

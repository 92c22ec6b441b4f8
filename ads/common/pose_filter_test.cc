#include "pose_filter.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace ads {
namespace {

using std::chrono::nanoseconds;
using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

constexpr double kPi = std::numbers::pi;

PlaneFix fix_at(double east_m, double north_m) {
  PlaneFix fix;
  fix.position_m = {east_m, north_m};
  return fix;
}

// A car whose motion is known, with its sensors: wheels and gyroscope every 10 ms, a fix every 100
// ms.
class Drive {
 public:
  explicit Drive(const PoseFilterConfig& config = {}) : filter(config), config_(config) {}

  double speed_mps = 10.0;
  double yaw_rate_radps = 0.0;
  double yaw_rad = 0.5 * kPi;
  double wheel_scale = 1.0;  // Of true speed over what the wheels say.
  double gyro_bias_radps = 0.0;
  nanoseconds fix_age{};
  bool has_fixes = true;
  Eigen::Vector2d fix_error_m{0.0, 0.0};

  Eigen::Vector2d axle_m{100.0, 50.0};
  PoseFilter filter;

  void go_on(nanoseconds duration) {
    const nanoseconds end = time_ + duration;
    while (time_ < end) {
      filter.on_yaw_rate(time_, yaw_rate_radps + gyro_bias_radps);
      filter.on_wheel_speed(time_, speed_mps / wheel_scale);
      if (has_fixes && time_.count() % nanoseconds(100ms).count() == 0) {
        give_fix();
      }
      move(10ms);
    }
    filter.on_wheel_speed(time_, speed_mps / wheel_scale);
  }

  [[nodiscard]] Eigen::Vector2d point() const {
    return axle_m +
           config_.rear_axle_to_point_m * Eigen::Vector2d(std::cos(yaw_rad), std::sin(yaw_rad));
  }
  [[nodiscard]] double error_m() const { return (filter.estimate().position_m - point()).norm(); }
  [[nodiscard]] nanoseconds time() const { return time_; }

 private:
  void give_fix() {
    // Where the point was before: the motion is constant for as long as a fix is old.
    const double age_s = std::chrono::duration<double>(fix_age).count();
    Drive past = *this;
    past.move(-age_s);
    const double turning_mps = yaw_rate_radps * config_.rear_axle_to_point_m;
    filter.on_fix(time_, fix_age,
                  {.position_m = past.point() + fix_error_m,
                   .yaw_rad = past.yaw_rad + std::atan2(turning_mps, speed_mps),
                   .speed_mps = std::hypot(speed_mps, turning_mps)});
  }

  void move(nanoseconds duration) {
    move(std::chrono::duration<double>(duration).count());
    time_ += duration;
  }

  void move(double duration_s) {
    const double middle = yaw_rad + 0.5 * yaw_rate_radps * duration_s;
    axle_m += speed_mps * duration_s * Eigen::Vector2d(std::cos(middle), std::sin(middle));
    yaw_rad += yaw_rate_radps * duration_s;
  }

  PoseFilterConfig config_;
  nanoseconds time_{};
};

TEST(PoseFilter, KnowsNothingBeforeTheFirstFix) {
  PoseFilter filter(PoseFilterConfig{});
  filter.on_wheel_speed(0ms, 10.0);
  filter.on_yaw_rate(10ms, 0.1);

  EXPECT_FALSE(filter.has_position());
}

TEST(PoseFilter, FirstFixIsThePosition) {
  PoseFilter filter(PoseFilterConfig{});
  filter.on_fix(0ms, 0ms, fix_at(3.0, 4.0));

  ASSERT_TRUE(filter.has_position());
  EXPECT_NEAR(filter.estimate().position_m.x(), 3.0, 1e-9);
  EXPECT_FALSE(filter.estimate().has_heading);
}

TEST(PoseFilter, LateFixesLeaveNoLag) {
  Drive drive;
  drive.fix_age = 200ms;
  drive.go_on(10s);

  EXPECT_LT(drive.error_m(), 0.02);
}

TEST(PoseFilter, LateFixesLeaveNoLagInACurve) {
  Drive drive;
  drive.fix_age = 200ms;
  drive.yaw_rate_radps = 0.2;
  drive.go_on(20s);

  EXPECT_LT(drive.error_m(), 0.1);
}

TEST(PoseFilter, WheelScaleIsLearned) {
  Drive drive;
  drive.wheel_scale = 1.02;
  drive.go_on(30s);

  EXPECT_NEAR(drive.filter.estimate().wheel_scale, 1.02, 0.003);
  EXPECT_LT(drive.error_m(), 0.3);
}

TEST(PoseFilter, GyroscopeOffsetIsLearnedWhileDriving) {
  Drive drive;
  drive.gyro_bias_radps = 0.005;
  drive.go_on(60s);

  EXPECT_NEAR(drive.filter.estimate().gyro_bias_radps, 0.005, 0.001);
  EXPECT_NEAR(drive.filter.estimate().yaw_rad, 0.5 * kPi, 0.01);
}

TEST(PoseFilter, GyroscopeOffsetIsLearnedWhileStanding) {
  Drive drive;
  drive.speed_mps = 0.0;
  drive.gyro_bias_radps = 0.005;
  drive.go_on(5s);

  EXPECT_NEAR(drive.filter.estimate().gyro_bias_radps, 0.005, 0.0005);
}

TEST(PoseFilter, WithoutFixesThePositionIsReckonedAndGetsLessCertain) {
  Drive drive;
  drive.go_on(20s);
  const double stddev_m = drive.filter.estimate().position_stddev_m;
  drive.has_fixes = false;
  drive.go_on(20s);

  EXPECT_LT(drive.error_m(), 0.5);
  EXPECT_GT(drive.filter.estimate().position_stddev_m, stddev_m);
}

TEST(PoseFilter, SingleOutlierIsRejected) {
  Drive drive;
  drive.go_on(5s);

  const bool is_good = drive.filter.on_fix(drive.time(), 0ms, fix_at(0.0, 0.0));

  EXPECT_FALSE(is_good);
  EXPECT_LT(drive.error_m(), 0.05);
}

TEST(PoseFilter, DriftOfTheFixesDoesNotTurnTheHeading) {
  Drive drive;
  drive.go_on(10s);
  for (int step = 0; step < 200; ++step) {
    drive.fix_error_m.x() += 0.01;
    drive.go_on(100ms);
  }

  EXPECT_NEAR(drive.filter.estimate().yaw_rad, 0.5 * kPi, 0.005);
  EXPECT_LT(drive.error_m(), 1.8);
}

TEST(PoseFilter, LastingJumpOfTheFixesIsBelievedInTheEnd) {
  Drive drive;
  drive.go_on(5s);
  drive.fix_error_m = {50.0, 0.0};
  drive.go_on(10s);

  EXPECT_NEAR(drive.error_m(), 50.0, 1.0);
}

TEST(PoseFilter, HeadingBeginsWhenTheCarMoves) {
  Drive drive;
  drive.speed_mps = 0.0;
  drive.go_on(3s);
  EXPECT_FALSE(drive.filter.estimate().has_heading);

  drive.speed_mps = 5.0;
  drive.go_on(10s);

  EXPECT_TRUE(drive.filter.estimate().has_heading);
  EXPECT_LT(drive.error_m(), 0.3);
}

TEST(PoseFilter, AfterALongGapItBeginsAnew) {
  Drive drive;
  drive.go_on(5s);

  drive.filter.on_wheel_speed(drive.time() + 60s, 10.0);

  EXPECT_FALSE(drive.filter.has_position());
}

TEST(PoseFilter, TimeThatGoesBackDoesNoHarm) {
  Drive drive;
  drive.go_on(5s);
  const auto before = drive.filter.estimate();

  drive.filter.on_wheel_speed(1s, 10.0);

  EXPECT_EQ(drive.filter.estimate().time, before.time);
  EXPECT_EQ(drive.filter.estimate().position_m, before.position_m);
}

}  // namespace
}  // namespace ads

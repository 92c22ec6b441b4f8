#include "localization.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "common/geodesy.h"

namespace rav4 {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

const ads::GeodeticPosition kOrigin{
    .latitude_deg = 37.72, .longitude_deg = -122.47, .altitude_m = 30.0};
constexpr double kSpeed_mps = 10.0;

// A car that drives north; its fixes are 200 ms old.
class LocalizationTest : public ::testing::Test {
 protected:
  LocalizationTest() {
    bench_.add<Localization>("localization", R"({"params": {"fix_delay_s": 0.2}})");
  }

  void drive(int milliseconds) {
    for (int end = elapsed_ms_ + milliseconds; elapsed_ms_ < end; elapsed_ms_ += 10) {
      turn_rates_.publish(turn_rate());
      auto speeds = measured<vehicle::WheelSpeeds>();
      speeds.set_rear_left_mps(kSpeed_mps);
      speeds.set_rear_right_mps(kSpeed_mps);
      wheel_speeds_.publish(speeds);
      if (elapsed_ms_ % 100 == 0) {
        // A thousandth of a degree of latitude is 111 m here.
        publish_fix(kOrigin.latitude_deg + kSpeed_mps * (elapsed_ms_ - 200) * 1e-3 / 110'990.0);
      }
      bench_.advance(10ms);
    }
  }

  void publish_fix(double latitude_deg) {
    auto fix = measured<gnss::Fix>();
    fix.set_latitude_deg(latitude_deg);
    fix.set_longitude_deg(kOrigin.longitude_deg);
    fix.set_altitude_m(kOrigin.altitude_m);
    fix.set_speed_mps(kSpeed_mps);
    fix.set_course_deg(0.0);
    fix.set_utc_ms(elapsed_ms_);
    fixes_.publish(fix);
  }

  motion::Imu turn_rate() {
    auto imu = measured<motion::Imu>();
    imu.mutable_angular_rate_radps();  // It does not turn.
    return imu;
  }

  template <typename Message>
  Message measured() {
    Message message;
    message.mutable_header()->set_taken_ns(bench_.now().time_since_epoch().count());
    return message;
  }

  int elapsed_ms_ = 0;
  Bench bench_;
  Bench::Input<gnss::Fix> fixes_ = bench_.input<gnss::Fix>("gnss/fix");
  Bench::Input<motion::Imu> turn_rates_ = bench_.input<motion::Imu>("imu/gyro");
  Bench::Input<vehicle::WheelSpeeds> wheel_speeds_ =
      bench_.input<vehicle::WheelSpeeds>("vehicle/wheel_speeds");
  Bench::Output<localization::Pose> poses_ = bench_.output<localization::Pose>("localization/pose");
};

TEST_F(LocalizationTest, PoseIsWhereTheCarIsNowAndNotWhereTheFixIs) {
  bench_.start();
  drive(10'000);

  const auto poses = poses_.take();

  ASSERT_GT(poses.size(), 900U);
  const auto& pose = poses.back();
  // The origin is the first fix: 2 m south of where the drive began.
  const double north_m = kSpeed_mps * (elapsed_ms_ - 10) * 1e-3 + 2.0;
  EXPECT_NEAR(pose.north_m(), north_m, 0.1);
  EXPECT_NEAR(pose.east_m(), 0.0, 0.05);
  EXPECT_NEAR(pose.north_mps(), kSpeed_mps, 0.1);
  EXPECT_NEAR(pose.yaw_rad(), 0.5 * std::numbers::pi, 0.01);
  EXPECT_TRUE(pose.has_heading());
  EXPECT_EQ(pose.header().frame(), "local_enu");
}

TEST_F(LocalizationTest, BadFixesAreRejectedAndCounted) {
  bench_.start();
  publish_fix(std::numeric_limits<double>::quiet_NaN());
  publish_fix(91.0);
  drive(1'000);
  publish_fix(kOrigin.latitude_deg + 1.0);
  const auto poses = poses_.take();
  bench_.stop();

  for (const auto& pose : poses) {
    ASSERT_TRUE(std::isfinite(pose.north_m()));
    ASSERT_LT(std::abs(pose.north_m()), 20.0);
  }
  EXPECT_EQ(std::get<std::int64_t>(bench_.result("localization", "fixes_rejected")), 3);
}

TEST_F(LocalizationTest, WithoutAFixThereIsNoPose) {
  bench_.start();
  wheel_speeds_.publish(measured<vehicle::WheelSpeeds>());

  EXPECT_TRUE(poses_.take().empty());
}

}  // namespace
}  // namespace rav4

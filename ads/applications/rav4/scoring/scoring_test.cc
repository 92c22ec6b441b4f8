#include "scoring.h"

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "applications/rav4/drive/small_drive.h"
#include "common/geodesy.h"

namespace rav4 {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

const ads::GeodeticPosition kOrigin{
    .latitude_deg = 37.72, .longitude_deg = -122.47, .altitude_m = 30.0};

// A car that drives east at 10 m/s, with a frame every 50 ms and one row of decoded wheel speeds.
class ScoringTest : public ::testing::Test {
 protected:
  ScoringTest() {
    const ads::LocalFrame plane(kOrigin);
    std::vector<double> times_s;
    std::vector<double> positions_m;
    for (int frame = 0; frame <= 20; ++frame) {
      const Eigen::Vector3d place = plane.ecef_from_enu({0.5 * frame, 0.0, 0.0});
      times_s.push_back(0.05 * frame);
      positions_m.insert(positions_m.end(), {place.x(), place.y(), place.z()});
    }
    drive_.reference(times_s, positions_m);
    drive_.can({0.0}, {0xaa}, {0}, {"12345678"});
    drive_.stream("CAN/wheel_speed", 4, {0.0}, {1.0, 2.0, 3.0, 4.0});
    bench_.add<Scoring>("scoring", drive_.configuration());
    bench_.start();
  }

  template <typename Message>
  Message measured() {
    Message message;
    message.mutable_header()->set_taken_ns(bench_.now().time_since_epoch().count());
    return message;
  }

  void publish_fix() {
    auto fix = measured<gnss::Fix>();
    fix.set_latitude_deg(kOrigin.latitude_deg);
    fix.set_longitude_deg(kOrigin.longitude_deg);
    fix.set_altitude_m(kOrigin.altitude_m);
    fixes_.publish(fix);
  }

  void publish_pose(double east_m) {
    auto pose = measured<localization::Pose>();
    pose.set_origin_latitude_deg(kOrigin.latitude_deg);
    pose.set_origin_longitude_deg(kOrigin.longitude_deg);
    pose.set_origin_altitude_m(kOrigin.altitude_m);
    pose.set_east_m(east_m);
    pose.set_east_mps(10.0);
    poses_.publish(pose);
  }

  [[nodiscard]] double result(const std::string& name) const {
    return std::get<double>(bench_.result("scoring", name));
  }

  testing::SmallDrive drive_{"scoring"};
  Bench bench_;
  Bench::Input<gnss::Fix> fixes_ = bench_.input<gnss::Fix>("gnss/fix");
  Bench::Input<localization::Pose> poses_ = bench_.input<localization::Pose>("localization/pose");
  Bench::Input<vehicle::WheelSpeeds> wheels_ =
      bench_.input<vehicle::WheelSpeeds>("vehicle/wheel_speeds");
  Bench::Output<scoring::Reference> references_ =
      bench_.output<scoring::Reference>("scoring/reference");
  Bench::Output<scoring::PositionError> errors_ =
      bench_.output<scoring::PositionError>("scoring/error");
};

TEST_F(ScoringTest, FixesAndEstimatesAreScored) {
  bench_.advance(100ms);
  publish_fix();
  publish_pose(1.25);
  bench_.advance(400ms);
  publish_pose(5.0);
  EXPECT_EQ(references_.take().at(0).east_m_size(), 21);
  EXPECT_GT(errors_.take().size(), 8U);
  bench_.stop();

  EXPECT_NEAR(result("raw_fix_error_mean_m"), 1.0, 1e-6);
  EXPECT_NEAR(result("position_error_max_m"), 0.25, 1e-6);
  EXPECT_EQ(std::get<std::int64_t>(bench_.result("scoring", "fixes")), 1);
}

TEST_F(ScoringTest, DecodedValuesAreCompared) {
  auto speeds = measured<vehicle::WheelSpeeds>();
  speeds.set_front_left_mps(1.0);
  speeds.set_front_right_mps(2.0);
  speeds.set_rear_left_mps(3.0);
  speeds.set_rear_right_mps(4.5);
  wheels_.publish(speeds);
  bench_.stop();

  EXPECT_DOUBLE_EQ(result("wheel_speed_decode_max_error_mps"), 0.5);
}

}  // namespace
}  // namespace rav4

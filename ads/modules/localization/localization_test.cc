#include "localization.h"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <Eigen/LU>
#include <fastcycle/testing.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/plane.h"
#include "noise.h"

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

constexpr double kWheelbase_m = 2.58;
constexpr double kAxle_m = 1.29;  // Behind the centre.

// A vehicle that winds its way, with the sensors of a simulated drive.
class Drive {
 public:
  explicit Drive(std::uint64_t seed) : random_(seed) {
    bench_.configure(R"({"topics": {"mission/initial_pose": {"latched": 1}}})");
    bench_.add<Localization>("localization");
    gyro_bias_radps_ = 0.0007 * normal_(random_);
    bench_.start();
  }

  void give_initial_pose() {
    mission::InitialPose pose = measured<mission::InitialPose>();
    pose.set_x_m(center().x() + 0.5 * normal_(random_));
    pose.set_y_m(center().y() + 0.5 * normal_(random_));
    pose.set_heading_rad(heading_rad_ + 0.02 * normal_(random_));
    pose.set_speed_mps(speed_mps_);
    pose.set_position_stddev_m(0.5);
    pose.set_heading_stddev_rad(0.02);
    poses_.publish(pose);
    initial_ = pose;
  }
  void give_initial_pose_again() { poses_.publish(initial_); }

  void go(int milliseconds) {
    for (int end = elapsed_ms_ + milliseconds; elapsed_ms_ < end; elapsed_ms_ += 10) {
      steering_rad_ = 0.03 * std::sin(0.2e-3 * elapsed_ms_);
      yaw_rate_radps_ = speed_mps_ * std::tan(steering_rad_) / kWheelbase_m;
      if (has_state) {
        give_state();
      }
      if (elapsed_ms_ % 100 == 0) {
        give_fix();
      }
      if (has_motion) {
        give_motion();
      }
      const double middle = heading_rad_ + 0.005 * yaw_rate_radps_;
      axle_m_ += 0.01 * speed_mps_ * direction(middle);
      heading_rad_ += 0.01 * yaw_rate_radps_;
      bench_.advance(10ms);
    }
  }

  [[nodiscard]] Eigen::Vector2d center() const {
    return axle_m_ + kAxle_m * direction(heading_rad_);
  }

  // Of the last estimate, against the truth of its time: 10 ms ago.
  [[nodiscard]] Eigen::Matrix<double, 5, 1> error(const localization::Ego& ego) const {
    const Eigen::Vector2d axle =
        axle_m_ - 0.01 * speed_mps_ * direction(heading_rad_ - 0.005 * yaw_rate_radps_);
    const double heading = heading_rad_ - 0.01 * yaw_rate_radps_;
    const Eigen::Vector2d truth = axle + kAxle_m * direction(heading);
    Eigen::Matrix<double, 5, 1> error;
    error << ego.x_m() - truth.x(), ego.y_m() - truth.y(),
        normalize_angle(ego.heading_rad() - heading), ego.speed_mps() - speed_mps_,
        ego.yaw_rate_radps() - yaw_rate_radps_;
    return error;
  }

  localization::Ego last() { return egos_.take().back(); }
  std::vector<localization::Ego> all() { return egos_.take(); }
  std::int64_t result(const std::string& name) {
    bench_.stop();
    return std::get<std::int64_t>(bench_.result("localization", name));
  }

  bool has_state = true;
  bool has_motion = true;
  bool is_frozen = false;  // Motions and fixes are the last ones, again and again.
  int fix_dropout = 0;
  bool has_fixes = true;
  Eigen::Vector2d fix_offset_m = Eigen::Vector2d::Zero();
  double speed_mps_ = 15.0;

 private:
  template <typename Message>
  Message measured() {
    Message message;
    message.mutable_header()->set_taken_ns(bench_.now().time_since_epoch().count());
    return message;
  }

  void give_state() {
    auto state = measured<vehicle::State>();
    state.set_speed_mps(std::round(speed_mps_ / 0.002) * 0.002);
    state.set_steering_rad(std::round(steering_rad_ / 1e-4) * 1e-4);
    states_.publish(state);
  }

  void give_fix() {
    const double east = east_.step(0.1, random_) + 0.1 * normal_(random_);
    const double north = north_.step(0.1, random_) + 0.1 * normal_(random_);
    ++fix_count_;
    if (!has_fixes || (fix_dropout > 0 && fix_count_ % fix_dropout == 0)) {
      return;
    }
    auto position = measured<gnss::Position>();
    position.set_x_m(center().x() + east + fix_offset_m.x());
    position.set_y_m(center().y() + north + fix_offset_m.y());
    position_ = is_frozen ? position_ : position;
    positions_.publish(position_);
  }

  void give_motion() {
    auto motion = measured<motion::Imu>();
    motion.mutable_acceleration_mps2()->set_x(0.04 + 0.67 * normal_(random_));
    motion.mutable_angular_rate_radps()->set_z(yaw_rate_radps_ + gyro_bias_radps_ +
                                               0.0028 * normal_(random_));
    motion_ = is_frozen ? motion_ : motion;
    motions_.publish(motion_);
  }

  mission::InitialPose initial_;
  gnss::Position position_;
  motion::Imu motion_;
  int elapsed_ms_ = 0;
  int fix_count_ = 0;
  Eigen::Vector2d axle_m_{100.0, 50.0};
  double heading_rad_ = 0.3;
  double steering_rad_ = 0.0;
  double yaw_rate_radps_ = 0.0;
  double gyro_bias_radps_ = 0.0;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  GaussMarkov east_{0.15, 60.0};
  GaussMarkov north_{0.15, 60.0};
  Bench bench_;
  Bench::Input<mission::InitialPose> poses_ =
      bench_.input<mission::InitialPose>("mission/initial_pose");
  Bench::Input<gnss::Position> positions_ = bench_.input<gnss::Position>("gnss/position");
  Bench::Input<motion::Imu> motions_ = bench_.input<motion::Imu>("imu/motion");
  Bench::Input<vehicle::State> states_ = bench_.input<vehicle::State>("vehicle/state");
  Bench::Output<localization::Ego> egos_ = bench_.output<localization::Ego>("localization/ego");
};

// As when the sender of the mission is restarted.
TEST(Localization, APoseOfLongAgoDoesNotMoveTheVehicleBack) {
  Drive drive(1);
  drive.give_initial_pose();
  drive.go(5'000);

  drive.give_initial_pose_again();
  drive.go(200);

  const localization::Ego ego = drive.last();
  EXPECT_EQ(ego.quality(), localization::GOOD);
  EXPECT_LT(drive.error(ego).head<2>().norm(), 1.5);
}

TEST(Localization, WithoutAnInitialPoseItIsInitializing) {
  Drive drive(1);
  drive.go(100);

  const auto egos = drive.all();
  ASSERT_EQ(egos.size(), 10U);
  EXPECT_EQ(egos.back().quality(), localization::INITIALIZING);
  EXPECT_NE(egos.back().reason(), "");
}

TEST(Localization, EstimateComesWithEachMotionAndIsGood) {
  Drive drive(1);
  drive.give_initial_pose();
  drive.go(10'000);

  const auto egos = drive.all();
  ASSERT_EQ(egos.size(), 1000U);
  const auto error = drive.error(egos.back());
  EXPECT_LT(error.head<2>().norm(), 0.5);
  EXPECT_LT(std::abs(error[2]), 0.02);
  EXPECT_LT(std::abs(error[3]), 0.1);
  EXPECT_NEAR(egos.back().acceleration_mps2(), 0.0, 0.5);
  EXPECT_EQ(egos.back().covariance_size(), 25);
  EXPECT_EQ(egos.back().quality(), localization::GOOD) << egos.back().reason();
  EXPECT_EQ(egos.back().header().frame(), "map");
}

// Normalized estimation error squared: of five dimensions its mean is 5.
double mean_nees(int fix_dropout) {
  double sum = 0.0;
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();  // Of position, heading and speed.
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Drive drive(seed);
    drive.fix_dropout = fix_dropout;
    drive.give_initial_pose();
    for (int part = 0; part < 10; ++part) {
      drive.go(2'000);
      const auto ego = drive.last();
      const auto error = drive.error(ego);
      Eigen::Matrix<double, 5, 5> covariance;
      for (int index = 0; index < 25; ++index) {
        covariance(index / 5, index % 5) = ego.covariance(index);
      }
      sum += error.dot(covariance.inverse() * error);
      squares +=
          Eigen::Vector3d(error.head<2>().squaredNorm(), error[2] * error[2], error[3] * error[3]);
      ++count;
      EXPECT_LT(error.head<2>().norm(), 0.8);
      EXPECT_EQ(ego.quality(), localization::GOOD) << ego.reason();
    }
  }
  fmt::print("NEES {:.2f} of 5, position {:.3f} m, heading {:.4f} rad, speed {:.3f} m/s (rms)\n",
             sum / count, std::sqrt(squares[0] / count), std::sqrt(squares[1] / count),
             std::sqrt(squares[2] / count));
  return sum / count;
}

TEST(ManyLocalizationDrives, ErrorsAreAsLargeAsTheCovarianceSays) {
  const double nees = mean_nees(0);

  EXPECT_GT(nees, 2.0);
  EXPECT_LT(nees, 8.0);
}

TEST(ManyLocalizationDrives, EveryThirdFixMayBeMissing) {
  const double nees = mean_nees(3);

  EXPECT_GT(nees, 2.0);
  EXPECT_LT(nees, 8.0);
}

TEST(Localization, OutliersAreRejectedAndSaid) {
  Drive drive(2);
  drive.give_initial_pose();
  drive.go(5'000);
  drive.fix_offset_m = {30.0, 0.0};
  drive.go(500);
  const auto uncertain = drive.last();
  drive.go(2'000);
  const auto lost = drive.last();

  EXPECT_LT(drive.error(lost).head<2>().norm(), 1.0);
  EXPECT_EQ(uncertain.quality(), localization::UNCERTAIN);
  EXPECT_EQ(uncertain.reason(), "5 fixes in a row were rejected");
  EXPECT_EQ(lost.quality(), localization::LOST);

  drive.fix_offset_m = {0.0, 0.0};
  drive.go(300);
  EXPECT_EQ(drive.last().quality(), localization::GOOD);
  EXPECT_EQ(drive.result("fixes_rejected"), 25);
}

TEST(Localization, WithoutFixesItIsUncertainAndThenLost) {
  Drive drive(3);
  drive.give_initial_pose();
  drive.go(5'000);
  drive.has_fixes = false;
  drive.go(3'000);
  const auto uncertain = drive.last();
  drive.go(8'000);
  const auto lost = drive.last();

  EXPECT_EQ(uncertain.quality(), localization::UNCERTAIN);
  EXPECT_NE(uncertain.reason().find("no fix was accepted for"), std::string::npos);
  EXPECT_EQ(lost.quality(), localization::LOST);
  EXPECT_LT(drive.error(lost).head<2>().norm(), 2.0);
  EXPECT_GT(lost.covariance(0), uncertain.covariance(0));
}

TEST(Localization, SilentBusIsALoss) {
  Drive drive(4);
  drive.give_initial_pose();
  drive.go(2'000);
  drive.has_state = false;
  drive.go(500);

  const auto ego = drive.last();
  EXPECT_EQ(ego.quality(), localization::LOST);
  EXPECT_NE(ego.reason().find("vehicle/state"), std::string::npos) << ego.reason();
}

TEST(Localization, SilentInertialSensorIsALossAndIsReported) {
  Drive drive(5);
  drive.give_initial_pose();
  drive.go(2'000);
  drive.has_motion = false;
  drive.all();
  drive.go(1'000);

  const auto ego = drive.last();
  EXPECT_EQ(ego.quality(), localization::LOST);
  EXPECT_NE(ego.reason().find("imu/motion"), std::string::npos) << ego.reason();
}

TEST(Localization, WithoutInertialSensorAndFixesTheSteeringTurnsTheVehicle) {
  Drive drive(8);
  drive.give_initial_pose();
  drive.go(6'000);  // Into a bend.
  drive.has_motion = false;
  drive.has_fixes = false;
  const auto before = drive.error(drive.last());
  drive.go(4'000);

  const auto ego = drive.last();
  const auto error = drive.error(ego);
  EXPECT_NEAR(error(2), before(2), 0.01);
  EXPECT_LT((error - before).head<2>().norm(), 0.5);
  EXPECT_GT(ego.covariance(12), 1e-4) << "the heading is less certain";
}

TEST(Localization, RepeatedMeasurementsAreNotUsed) {
  Drive drive(8);
  drive.give_initial_pose();
  drive.go(6'000);
  drive.is_frozen = true;
  const auto before = drive.error(drive.last());
  drive.go(4'000);

  const auto ego = drive.last();
  EXPECT_LT((drive.error(ego) - before).head<2>().norm(), 0.5);
  EXPECT_EQ(ego.quality(), localization::LOST);
  EXPECT_NE(ego.reason().find("imu/motion"), std::string::npos) << ego.reason();
  EXPECT_EQ(drive.result("inputs_invalid"), 440);
}

TEST(Localization, StandingVehicleStands) {
  Drive drive(6);
  drive.speed_mps_ = 0.0;
  drive.give_initial_pose();
  drive.go(10'000);

  const auto ego = drive.last();
  EXPECT_NEAR(ego.speed_mps(), 0.0, 0.05);
  EXPECT_LT(drive.error(ego).head<2>().norm(), 0.6);
  EXPECT_LT(std::abs(drive.error(ego)[2]), 0.08);
}

}  // namespace
}  // namespace ads

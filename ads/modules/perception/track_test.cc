#include "track.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "common/plane.h"

namespace ads {
namespace {

constexpr double kSpread_rad = 0.0035;
constexpr std::int64_t kSweep_ns = 100'000'000;

// A box that drives by a sensor at the origin.
class TrackTest : public ::testing::Test {
 protected:
  void sight() {
    std::vector<ObjectPoint> points;
    std::vector<LidarReturn> returns;
    const double middle = std::atan2(box_.center_m.y(), box_.center_m.x());
    for (double off = -1.0; off < 1.0; off += kSpread_rad) {
      const double azimuth = middle + off;
      double range = 0.0;
      while (range < 60.0 && !box_.contains(range * direction(azimuth))) {
        range += 0.01;
      }
      if (range < 60.0) {
        returns.push_back(
            {.azimuth_rad = static_cast<float>(azimuth), .range_m = static_cast<float>(range)});
        for (const float height : {0.3F, 0.7F, 1.1F}) {
          points.push_back({.place_m = range * direction(azimuth),
                            .height_m = height,
                            .azimuth_rad = static_cast<float>(azimuth),
                            .range_m = static_cast<float>(range)});
        }
      }
    }
    skyline_.fill(returns, 1.7);
    track_.predict(time_ns_);
    track_.update({.points = points, .spread_rad = kSpread_rad}, skyline_);
  }

  void drive(int sweeps) {
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      sight();
      time_ns_ += kSweep_ns;
      box_.heading_rad += 0.1 * yaw_rate_radps_;
      box_.center_m += 0.1 * speed_mps_ * direction(box_.heading_rad);
    }
    track_.predict(time_ns_);
  }

  Box box_{.center_m = {-20.0, 4.0}, .heading_rad = 0.0, .length_m = 4.4, .width_m = 1.8};
  double speed_mps_ = 10.0;
  double yaw_rate_radps_ = 0.0;
  std::int64_t time_ns_ = 0;
  Skyline skyline_;
  Track track_{TrackConfig{}, 0, {-20.0, 4.0}, 0.0};
};

TEST_F(TrackTest, SpeedAndPlaceAreFound) {
  drive(15);

  EXPECT_NEAR(track_.speed_mps(), 10.0, 0.2);
  EXPECT_LT((track_.center_m() - box_.center_m).norm(), 0.15);
  EXPECT_NEAR(track_.heading_rad(), 0.0, 0.02);
}

TEST_F(TrackTest, CenterDoesNotJumpWhenOtherSidesAreSeen) {
  drive(12);
  double worst_m = 0.0;
  for (int sweep = 0; sweep < 25; ++sweep) {
    drive(1);
    worst_m = std::max(worst_m, (track_.center_m() - box_.center_m).norm());
  }

  EXPECT_GT(box_.center_m.x(), 10.0);
  EXPECT_LT(worst_m, 0.2);
  EXPECT_NEAR(track_.length_m(), 4.4, 0.15);
  EXPECT_NEAR(track_.width_m(), 1.8, 0.15);
}

TEST_F(TrackTest, HeadingThatWasTakenForItsOppositeIsTurned) {
  track_ = Track(TrackConfig{}, 0, {-20.0, 4.0}, std::numbers::pi);
  drive(10);

  EXPECT_NEAR(track_.heading_rad(), 0.0, 0.02);
  EXPECT_NEAR(track_.speed_mps(), 10.0, 0.3);
}

TEST_F(TrackTest, BoxThatWasTakenForOneAcrossIsTurned) {
  track_ = Track(TrackConfig{}, 0, {-20.0, 4.0}, 0.5 * std::numbers::pi);
  drive(20);

  EXPECT_NEAR(track_.heading_rad(), 0.0, 0.05);
  EXPECT_LT((track_.center_m() - box_.center_m).norm(), 0.3);
}

TEST_F(TrackTest, TurnIsFollowed) {
  box_.center_m = {10.0, 8.0};
  track_ = Track(TrackConfig{}, 0, box_.center_m, 0.0);
  speed_mps_ = 6.0;
  yaw_rate_radps_ = 0.3;
  drive(25);

  EXPECT_NEAR(track_.heading_rad(), box_.heading_rad, 0.06);
  EXPECT_NEAR(track_.yaw_rate_radps(), 0.3, 0.1);
}

TEST_F(TrackTest, StandingBoxStands) {
  speed_mps_ = 0.0;
  drive(20);

  EXPECT_NEAR(track_.speed_mps(), 0.0, 0.1);
  EXPECT_LT((track_.center_m() - box_.center_m).norm(), 0.2);
}

TEST_F(TrackTest, WithoutSightingItGetsLessCertain) {
  drive(15);
  const double stddev_m = track_.position_stddev_m();
  track_.predict(time_ns_ + 10 * kSweep_ns);

  EXPECT_GT(track_.position_stddev_m(), 2.0 * stddev_m);
}

TEST_F(TrackTest, OnlyBoundsPushAndNeverPull) {
  drive(15);
  const double length_m = track_.length_m();
  const std::vector<ObjectPoint> roof{
      {.place_m = track_.center_m(), .height_m = 1.1F, .range_m = 20.0F}};
  track_.update({.points = roof, .spread_rad = kSpread_rad}, skyline_);

  EXPECT_EQ(track_.length_m(), length_m);
}

}  // namespace
}  // namespace ads

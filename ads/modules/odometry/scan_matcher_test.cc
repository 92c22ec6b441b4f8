#include "scan_matcher.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace odometry {
namespace {

// Houses and posts beside a street, seen in one turn that ends where the sensor is.
std::vector<TimedPoint> street(const Pose& end, const Pose& rate, double passed_s) {
  std::vector<Eigen::Vector2d> places;
  for (int house = -3; house < 6; ++house) {
    for (double along = 0.0; along < 8.0; along += 0.2) {
      places.emplace_back(12.0 * house + along, 9.0 + 0.4 * (house % 3));
      places.emplace_back(12.0 * house + along, -8.0 - 0.3 * (house % 2));
    }
    for (double deep = 0.0; deep < 4.0; deep += 0.2) {
      places.emplace_back(12.0 * house, 9.0 + deep);
      places.emplace_back(12.0 * house + 8.0, -8.0 - deep);
    }
  }
  std::vector<TimedPoint> points;
  for (const Eigen::Vector2d& place : places) {
    for (const float height : {-0.8F, 0.0F, 0.8F}) {
      const double turned = std::atan2(place.y() - end.place_m.y(), place.x() - end.place_m.x());
      const double share = 0.5 - turned / (2.0 * std::numbers::pi);
      const double before_s = (share - 1.0) * passed_s;
      const Pose then = end.moved(
          {.place_m = before_s * rate.place_m, .heading_rad = before_s * rate.heading_rad});
      const Eigen::Vector2d seen = Eigen::Rotation2Dd(-then.heading_rad) * (place - then.place_m);
      points.push_back(
          {.place_m = {static_cast<float>(seen.x()), static_cast<float>(seen.y()), height},
           .share = static_cast<float>(share)});
    }
  }
  return points;
}

TEST(ScanMatcher, FollowsADriveAroundABend) {
  const Pose rate{.place_m = {8.0, 0.0}, .heading_rad = 0.15};
  ScanMatcher matcher({});
  Pose truth;
  for (int sweep = 0; sweep < 12; ++sweep) {
    matcher.take(street(truth, rate, 0.1), 0.1, 0.1);
    EXPECT_LT((matcher.pose().place_m - truth.place_m).norm(), 0.15) << "sweep " << sweep;
    EXPECT_NEAR(matcher.pose().heading_rad, truth.heading_rad, 0.02) << "sweep " << sweep;
    truth = truth.moved({.place_m = 0.1 * rate.place_m, .heading_rad = 0.1 * rate.heading_rad});
  }
  EXPECT_NEAR(matcher.rate().place_m.x(), 8.0, 0.8);
}

TEST(ManySweeps, AreFollowedWhereSomeAreMissing) {
  const Pose rate{.place_m = {9.0, 0.0}, .heading_rad = 0.05};
  ScanMatcher matcher({});
  Pose truth;
  for (int sweep = 0; sweep < 4; ++sweep) {
    matcher.take(street(truth, rate, 0.1), 0.1, sweep == 0 ? 0.1 : 0.7);
    EXPECT_LT((matcher.pose().place_m - truth.place_m).norm(), 0.2) << "sweep " << sweep;
    EXPECT_NEAR(matcher.pose().heading_rad, truth.heading_rad, 0.02) << "sweep " << sweep;
    truth = truth.moved({.place_m = 0.7 * rate.place_m, .heading_rad = 0.7 * rate.heading_rad});
  }
}

TEST(ScanMatcher, StandsWhereNothingMoves) {
  ScanMatcher matcher({});
  for (int sweep = 0; sweep < 3; ++sweep) {
    matcher.take(street({}, {}, 0.1), 0.1, 0.1);
  }
  EXPECT_LT(matcher.pose().place_m.norm(), 0.1) << "the points of the map lie so far apart";
  EXPECT_GT(matcher.matched_share(), 0.99);
}

TEST(ScanMatcher, EmptySweepsGoOnAsItMoved) {
  ScanMatcher matcher({});
  matcher.take({}, 0.1, 0.1);
  matcher.take({}, 0.1, 0.1);
  EXPECT_EQ(matcher.pose().place_m.norm(), 0.0);
}

TEST(Pose, MotionIsWhatLeadsFromOneToTheOther) {
  const Pose from{.place_m = {3.0, -1.0}, .heading_rad = 2.0};
  const Pose to{.place_m = {-2.0, 4.0}, .heading_rad = -2.5};
  const Pose again = from.moved(from.motion_to(to));
  EXPECT_NEAR((again.place_m - to.place_m).norm(), 0.0, 1e-12);
  EXPECT_NEAR(again.heading_rad, to.heading_rad, 1e-12);
}

}  // namespace
}  // namespace odometry

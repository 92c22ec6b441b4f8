#include "road.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "straight_road.h"

namespace motion_planning {
namespace {

// Along x, then a quarter of a circle to the left with a radius of 20 m, then along y.
Road bent_road() {
  std::vector<RoadPoint> points;
  const auto add = [&](double x, double y) {
    points.push_back({.x_m = x, .y_m = y, .left_edge_m = 2.0, .right_edge_m = 5.0});
  };
  for (double x = 0.0; x < 50.0; x += 2.0) {
    add(x, 0.0);
  }
  for (double angle = 0.0; angle < std::numbers::pi / 2.0; angle += 0.05) {
    add(50.0 + 20.0 * std::sin(angle), 20.0 - 20.0 * std::cos(angle));
  }
  for (double y = 20.0; y < 60.0; y += 2.0) {
    add(70.0, y);
  }
  return Road(points);
}

TEST(Road, WithoutALineIsEmpty) {
  EXPECT_TRUE(Road().is_empty());
  EXPECT_TRUE(Road(std::vector<RoadPoint>{{.x_m = 1.0}}).is_empty());
}

TEST(Road, FindsPlacesInACurveAgain) {
  const Road road = bent_road();
  for (const double along : {10.0, 49.0, 60.0, 75.0, 90.0}) {
    for (const double offset : {-3.0, 0.0, 3.0}) {
      const Pose pose = road.pose(along, offset);
      const RoadPlace place = road.locate(pose.x_m, pose.y_m);

      EXPECT_NEAR(place.along_m, along, 0.15);
      EXPECT_NEAR(place.offset_m, offset, 0.02);
      EXPECT_NEAR(place.heading_rad, pose.heading_rad, 0.02);
    }
  }
}

TEST(Road, NoPlaceOfALongWindingRoadIsNearerThanTheOneFound) {
  // A spiral, whose turns lie 4 m beside each other.
  std::vector<RoadPoint> points;
  for (double turn = 4.0; turn < 60.0; turn += 0.02) {
    const double radius = 4.0 * turn / (2.0 * std::numbers::pi);
    points.push_back({.x_m = radius * std::cos(turn), .y_m = radius * std::sin(turn)});
  }
  const Road road(points);
  for (double x = -50.0; x < 50.0; x += 9.1) {
    for (double y = -50.0; y < 50.0; y += 7.3) {
      double least = std::numeric_limits<double>::infinity();
      for (double along = 0.0; along <= road.length_m(); along += 1.0) {
        const Pose pose = road.pose(along, 0.0);
        least = std::min(least, std::hypot(pose.x_m - x, pose.y_m - y));
      }
      EXPECT_LE(std::abs(road.locate(x, y).offset_m), least + 1e-9) << x << ", " << y;
    }
  }
}

TEST(Road, SearchFromAPlaceNearbyFindsTheSame) {
  const Road road = bent_road();
  const RoadPlace whole = road.locate(66.0, 9.0);
  const RoadPlace near = road.locate_near(66.0, 9.0, whole.index - 12);

  EXPECT_EQ(near.along_m, whole.along_m);
  EXPECT_EQ(near.offset_m, whole.offset_m);
}

TEST(Road, GoesOnStraightBeyondItsEnds) {
  const Road road = straight_road();

  EXPECT_NEAR(road.locate(-70.0, 1.0).along_m, -20.0, 1e-9);
  EXPECT_NEAR(road.locate(-70.0, 1.0).offset_m, 1.0, 1e-9);
  EXPECT_NEAR(road.pose(470.0, -2.0).x_m, 420.0, 1e-9);
  EXPECT_NEAR(road.pose(470.0, -2.0).y_m, -2.0, 1e-9);
}

TEST(Road, CurvatureIsThatOfItsLine) {
  EXPECT_NEAR(bent_road().curvature_per_m(65.0), 1.0 / 20.0, 0.02);
  EXPECT_EQ(straight_road().curvature_per_m(65.0), 0.0);
}

TEST(Road, KnowsTheNearestLane) {
  const Road road = straight_road();

  EXPECT_NEAR(road.lane_m(100.0, 0.4), 0.0, 1e-9);
  EXPECT_NEAR(road.lane_m(100.0, -2.5), -kLane_m, 1e-9);
}

TEST(Road, WithoutLanesOnesPlaceIsRight) {
  EXPECT_EQ(bent_road().lane_m(10.0, 0.7), 0.7);
}

TEST(Road, LaneOfTheOtherDirectionIsNoLane) {
  Road road({{.x_m = 0.0, .left_edge_m = 5.0, .right_edge_m = 5.0},
             {.x_m = 100.0, .left_edge_m = 5.0, .right_edge_m = 5.0}});
  road.add_lane({{100.0, 3.0}, {0.0, 3.0}});

  EXPECT_EQ(road.lane_m(50.0, 2.0), 2.0);
}

}  // namespace
}  // namespace motion_planning

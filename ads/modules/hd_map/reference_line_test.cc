#include "reference_line.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include <gtest/gtest.h>

#include "straight_road.h"

namespace ads {
namespace {

ReferenceLine line_between(const LaneGraph& graph, const Eigen::Vector2d& start,
                           const Eigen::Vector2d& goal) {
  return reference_line(
      graph, std::get<LanePath>(find_path(graph, start, 0.0, {.place_m = goal}, {})), {});
}

TEST(ReferenceLine, FollowsTheLaneAndGoesBeyondBothEnds) {
  const LaneGraph graph(straight_road(3, 3));

  const auto line = line_between(graph, {110.0, 3.5}, {270.0, 3.5});

  EXPECT_NEAR(line.points_m.front().x(), 50.0, 1e-6);
  EXPECT_NEAR(line.points_m.back().x(), 330.0, 1e-6);
  for (std::size_t index = 0; index < line.points_m.size(); ++index) {
    EXPECT_NEAR(line.points_m[index].y(), 3.5, 1e-9);
    EXPECT_NEAR(line.left_edge_m[index], 5.25, 1e-9);
    EXPECT_NEAR(line.right_edge_m[index], 5.25, 1e-9);
    EXPECT_EQ(line.speed_limit_mps[index], 20.0);
    if (index > 0) {
      EXPECT_NEAR((line.points_m[index] - line.points_m[index - 1]).norm(), 1.0, 0.05);
    }
  }
}

TEST(ReferenceLine, GoesStraightBeforeTheMap) {
  const LaneGraph graph(straight_road(2, 1));

  const auto line = line_between(graph, {-30.0, 0.0}, {150.0, 0.0});

  EXPECT_NEAR(line.points_m.front().x(), -90.0, 1e-6);
  EXPECT_NEAR(line.points_m.back().x(), 210.0, 1e-6);
}

TEST(ReferenceLine, GoesOverToAnotherLaneWithoutAJump) {
  const LaneGraph graph(straight_road(3, 3));

  const auto line = line_between(graph, {20.0, 0.0}, {250.0, 7.0});
  const Polyline polyline(line.points_m);

  EXPECT_NEAR(line.points_m.front().y(), 0.0, 1e-9);
  EXPECT_NEAR(line.points_m.back().y(), 7.0, 1e-9);
  for (double along = 0.0; along < polyline.length_m(); along += 1.0) {
    EXPECT_LT(std::abs(polyline.heading_at(along)), 0.2);
    EXPECT_LT(std::abs(polyline.curvature_at(along)), 0.02);
  }
  for (std::size_t index = 0; index < line.points_m.size(); ++index) {
    EXPECT_NEAR(line.points_m[index].y() + line.left_edge_m[index], 8.75, 1e-6);
    EXPECT_NEAR(line.points_m[index].y() - line.right_edge_m[index], -1.75, 1e-6);
  }
}

TEST(ReferenceLine, CornerOfTheMapIsRounded) {
  auto road = straight_road(2, 1);
  road[1].left_m = {{100.0, 1.75}, {198.0, 21.75}};
  road[1].right_m = {{100.0, -1.75}, {198.0, 18.25}};
  const LaneGraph graph(road);

  const Polyline line(line_between(graph, {20.0, 0.0}, {180.0, 16.0}).points_m);

  for (double along = 0.0; along < line.length_m(); along += 0.5) {
    EXPECT_LT(std::abs(line.curvature_at(along)), 0.06);
  }
}

TEST(ReferenceLine, ShortPathHasALineToo) {
  const LaneGraph graph(straight_road(1, 2));

  const auto line = line_between(graph, {50.0, 0.0}, {51.0, 3.5});

  EXPECT_GT(line.points_m.size(), 100U);
  EXPECT_NEAR(line.points_m.back().y(), 3.5, 1e-6);
}

}  // namespace
}  // namespace ads

#include "router.h"

#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include <gmock/gmock.h>

#include "straight_road.h"

namespace ads {
namespace {

using ::testing::ElementsAre;

std::vector<std::int64_t> lanes_of(const std::variant<LanePath, std::string>& found) {
  std::vector<std::int64_t> lanes;
  if (const auto* path = std::get_if<LanePath>(&found)) {
    for (const LanePath::Step& step : path->steps) {
      lanes.push_back(step.lane);
    }
  }
  return lanes;
}

std::string reason(const std::variant<LanePath, std::string>& found) {
  const auto* text = std::get_if<std::string>(&found);
  return text == nullptr ? "" : *text;
}

TEST(Router, WayFollowsTheLane) {
  const LaneGraph graph(straight_road(3, 2));

  const auto found =
      find_path(graph, {20.0, 0.0}, 0.0, {.place_m = Eigen::Vector2d(250.0, 0.5)}, {});

  EXPECT_THAT(lanes_of(found), ElementsAre(1, 11, 21));
  EXPECT_NEAR(std::get<LanePath>(found).start_along_m, 20.0, 1e-9);
  EXPECT_NEAR(std::get<LanePath>(found).goal_along_m, 50.0, 1e-9);
}

TEST(Router, GoalOnAnotherLaneNeedsAChange) {
  const LaneGraph graph(straight_road(3, 3));

  const auto found =
      find_path(graph, {20.0, 0.0}, 0.0, {.place_m = Eigen::Vector2d(250.0, 7.0)}, {});

  EXPECT_EQ(lanes_of(found).size(), 5U);
  EXPECT_EQ(lanes_of(found).back(), 23);
}

TEST(Router, ChangeIsMadeWhereThereIsRoomForIt) {
  const LaneGraph graph(straight_road(2, 2));

  const auto found =
      find_path(graph, {95.0, 0.0}, 0.0, {.place_m = Eigen::Vector2d(190.0, 3.5)}, {});

  EXPECT_THAT(lanes_of(found), ElementsAre(1, 11, 12));
}

TEST(Router, ChangeIsNotMadeShortBeforeTheGoal) {
  const LaneGraph graph(straight_road(3, 2));

  const auto found =
      find_path(graph, {95.0, 0.0}, 0.0, {.place_m = Eigen::Vector2d(210.0, 3.5)}, {});

  EXPECT_THAT(lanes_of(found), ElementsAre(1, 11, 12, 22));
}

TEST(Router, GoalBetweenLanesNeedsNoChange) {
  const LaneGraph graph(straight_road(2, 2));

  const auto found =
      find_path(graph, {20.0, 0.0}, 0.0, {.place_m = Eigen::Vector2d(150.0, 1.75)}, {});

  EXPECT_THAT(lanes_of(found), ElementsAre(1, 11));
}

TEST(Router, GoalMayBeGivenByLanes) {
  const LaneGraph graph(straight_road(2, 2));

  EXPECT_THAT(lanes_of(find_path(graph, {20.0, 3.5}, 0.0, {.lanes = {12, 99}}, {})),
              ElementsAre(2, 12));
}

TEST(Router, WithoutAPlaceItGoesStraightOn) {
  const LaneGraph graph(straight_road(3, 2));

  EXPECT_THAT(lanes_of(find_path(graph, {20.0, 3.5}, 0.0, {}, {})), ElementsAre(2, 12, 22));
}

// A lane along x that forks: lane 2 turns right on a quarter of a circle, and lane 4 goes on from
// it; lane 3 goes straight on to `straight_end_m`.
std::vector<MapLane> fork(double straight_end_m) {
  constexpr double kRadius_m = 20.0;
  const auto straight = [](std::int64_t id, const Eigen::Vector2d& begin_m,
                           const Eigen::Vector2d& end_m) {
    const Eigen::Vector2d along = (end_m - begin_m).normalized();
    const Eigen::Vector2d left = 1.75 * Eigen::Vector2d(-along.y(), along.x());
    return MapLane{.id = id,
                   .left_m = {begin_m + left, end_m + left},
                   .right_m = {begin_m - left, end_m - left},
                   .speed_limit_mps = 20.0};
  };
  std::vector<MapLane> road = {
      straight(1, {0.0, 0.0}, {30.0, 0.0}), MapLane{.id = 2, .speed_limit_mps = 20.0},
      straight(3, {30.0, 0.0}, {straight_end_m, 0.0}), straight(4, {50.0, -20.0}, {50.0, -120.0})};
  for (int step = 0; step <= 9; ++step) {
    const double angle = step * M_PI / 18.0;
    const auto at = [&](double radius_m) {
      return Eigen::Vector2d(30.0 + radius_m * std::sin(angle),
                             -kRadius_m + radius_m * std::cos(angle));
    };
    road[1].left_m.push_back(at(kRadius_m + 1.75));
    road[1].right_m.push_back(at(kRadius_m - 1.75));
  }
  road[0].successors = {2, 3};
  road[1].predecessors = {1};
  road[1].successors = {4};
  road[2].predecessors = {1};
  road[3].predecessors = {2};
  return road;
}

TEST(Router, WithoutAPlaceItGoesWhereTheVehicleHeads) {
  const LaneGraph graph(fork(150.0));

  EXPECT_THAT(lanes_of(find_path(graph, {5.0, 0.0}, 0.0, {}, {})), ElementsAre(1, 3));
  EXPECT_THAT(lanes_of(find_path(graph, {25.0, -0.5}, -1.0, {}, {})), ElementsAre(1, 2, 4))
      << "a vehicle that turns already";
}

TEST(Router, WithoutAPlaceTheStraightestOfLanesThatOverlapIsTaken) {
  std::vector<MapLane> road = fork(150.0);
  road.erase(road.begin());
  road[0].predecessors = {};
  road[1].predecessors = {};

  EXPECT_THAT(lanes_of(find_path(LaneGraph(road), {31.0, 0.0}, -0.1, {}, {})), ElementsAre(3))
      << "where they begin, the heading alone would choose the other";
}

TEST(Router, WithoutAPlaceItDoesNotTakeALaneThatEndsSoon) {
  EXPECT_THAT(lanes_of(find_path(LaneGraph(fork(31.0)), {5.0, 0.0}, 0.0, {}, {})),
              ElementsAre(1, 2, 4));
}

TEST(Router, WithoutAPlaceACircleOfLanesEnds) {
  auto road = straight_road(3, 1, 10.0);
  road[2].successors = {1};
  road[0].predecessors = {21};

  const auto found = find_path(LaneGraph(road), {5.0, 0.0}, 0.0, {}, {.anywhere_m = 120.0});

  EXPECT_EQ(lanes_of(found).size(), 13U);
}

TEST(Router, StartMayLieBeforeTheMap) {
  const LaneGraph graph(straight_road(2, 1));

  const auto found =
      find_path(graph, {-40.0, 0.0}, 0.0, {.place_m = Eigen::Vector2d(150.0, 0.0)}, {});

  EXPECT_THAT(lanes_of(found), ElementsAre(1, 11));
  EXPECT_NEAR(std::get<LanePath>(found).start_along_m, -40.0, 1e-9);
}

TEST(Router, WhatIsOnALaneIsNotBehindTheEndOfAnother) {
  auto road = straight_road(2, 1);
  road[0].successors = {};
  road[1].predecessors = {};
  EXPECT_THAT(lanes_of(find_path(LaneGraph(road), {120.0, 0.0}, 0.0,
                                 {.place_m = Eigen::Vector2d(180.0, 0.0)}, {})),
              ElementsAre(11));
}

TEST(Router, GoalBehindTheStartNeedsAWayRound) {
  auto road = straight_road(3, 1);
  const LaneGraph graph(road);
  EXPECT_EQ(reason(find_path(graph, {80.0, 0.0}, 0.0, {.place_m = Eigen::Vector2d(20.0, 0.0)}, {})),
            "no way leads from lane 1 to lane 1");

  road[2].successors = {1};
  road[0].predecessors = {21};
  EXPECT_THAT(lanes_of(find_path(LaneGraph(road), {80.0, 0.0}, 0.0,
                                 {.place_m = Eigen::Vector2d(20.0, 0.0)}, {})),
              ElementsAre(1, 11, 21, 1));
}

TEST(Router, WhatIsOffTheMapIsReported) {
  const LaneGraph graph(straight_road(2, 1));

  EXPECT_EQ(reason(find_path(graph, {50.0, 30.0}, 0.0, {}, {})),
            "the start (50.0, 30.0) is 28.2 m from the nearest lane in its direction");
  EXPECT_EQ(
      reason(find_path(graph, {50.0, 0.0}, 0.0, {.place_m = Eigen::Vector2d(50.0, -9.0)}, {})),
      "the goal (50.0, -9.0) is 7.2 m from the nearest lane in its direction");
  EXPECT_EQ(reason(find_path(graph, {50.0, 0.0}, 3.0, {}, {})),
            "the start (50.0, 0.0): the map has no lane in its direction");
  EXPECT_EQ(reason(find_path(graph, {50.0, 0.0}, 0.0, {.lanes = {98, 99}}, {})),
            "none of the goal's lanes 98, 99 is in the map");
}

}  // namespace
}  // namespace ads

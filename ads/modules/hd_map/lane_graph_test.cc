#include "lane_graph.h"

#include <cstdlib>
#include <filesystem>
#include <map>
#include <stdexcept>

#include <gmock/gmock.h>

#include "common/commonroad.h"
#include "commonroad_lanes.h"
#include "straight_road.h"

namespace ads {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

MapLane crossroad_lane(std::int64_t id, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const Eigen::Vector2d side = 1.75 * left_of((to - from).normalized());
  return {.id = id, .left_m = {from + side, to + side}, .right_m = {from - side, to - side}};
}

// To the east (1), and to the north (2), which comes from the right of the first.
std::vector<MapLane> crossroad() {
  return {crossroad_lane(1, {-10.0, 0.0}, {10.0, 0.0}),
          crossroad_lane(2, {0.0, -10.0}, {0.0, 10.0})};
}

TEST(LaneGraph, LanesSideBySideAreFoundFromRightToLeft) {
  const LaneGraph graph(straight_road(1, 3));

  EXPECT_THAT(graph.beside(2), ElementsAre(1, 2, 3));
  EXPECT_THAT(graph.node(2).conflicts, IsEmpty());
}

TEST(LaneGraph, ShoulderIsNoLaneToDriveOn) {
  auto road = straight_road(1, 3);
  road[0].kind = LaneKind::kShoulder;

  EXPECT_THAT(LaneGraph(road).beside(3), ElementsAre(2, 3));
}

TEST(LaneGraph, LanesThatCrossAreInConflict) {
  const LaneGraph graph(crossroad());

  EXPECT_THAT(graph.node(1).conflicts, ElementsAre(2));
  EXPECT_THAT(graph.node(2).conflicts, ElementsAre(1));
  EXPECT_THAT(graph.node(1).yields_to, IsEmpty());
}

TEST(LaneGraph, SignSaysWhoYields) {
  auto lanes = crossroad();
  lanes[1].priority = -1;
  lanes[0].from_right = {2};
  const LaneGraph graph(lanes);

  EXPECT_THAT(graph.node(2).yields_to, ElementsAre(1));
  EXPECT_THAT(graph.node(1).yields_to, IsEmpty());
}

TEST(LaneGraph, WithoutSignsTheOneFromTheRightGoesFirst) {
  auto lanes = crossroad();
  lanes[0].from_right = {2};
  const LaneGraph graph(lanes);

  EXPECT_THAT(graph.node(1).yields_to, ElementsAre(2));
  EXPECT_THAT(graph.node(2).yields_to, IsEmpty());
}

TEST(LaneGraph, WhoTurnsLeftYieldsToOncomingTraffic) {
  MapLane turn{.id = 1,
               .left_m = {{-10.0, 0.0}, {-4.0, 2.0}, {-1.75, 10.0}},
               .right_m = {{-10.0, -3.5}, {-1.0, -1.0}, {1.75, 10.0}}};
  const LaneGraph graph({turn, crossroad_lane(2, {10.0, 3.0}, {-10.0, 3.0})});

  EXPECT_THAT(graph.node(1).yields_to, ElementsAre(2));
  EXPECT_THAT(graph.node(2).yields_to, IsEmpty());
}

TEST(LaneGraph, WhereTrafficKeepsToTheLeftWhoTurnsRightYieldsToOncomingTraffic) {
  MapLane turn{.id = 1,
               .left_m = {{-10.0, 3.5}, {-1.0, 1.0}, {1.75, -10.0}},
               .right_m = {{-10.0, 0.0}, {-4.0, -2.0}, {-1.75, -10.0}}};
  // Lanes of a road elsewhere, each with the other on its right.
  MapLane out = crossroad_lane(3, {100.0, 0.0}, {200.0, 0.0});
  MapLane back = crossroad_lane(4, {200.0, -3.5}, {100.0, -3.5});
  out.right = {.id = 4, .is_same_direction = false};
  back.right = {.id = 3, .is_same_direction = false};
  const LaneGraph graph({turn, crossroad_lane(2, {10.0, -3.0}, {-10.0, -3.0}), out, back});

  EXPECT_THAT(graph.node(1).yields_to, ElementsAre(2));
  EXPECT_THAT(graph.node(2).yields_to, IsEmpty());
}

TEST(LaneGraph, RampYieldsToTheRoadThatItJoins) {
  auto lanes = straight_road(2, 1);
  lanes.push_back(crossroad_lane(5, {0.0, -30.0}, {100.0, 0.0}));
  lanes.back().kind = LaneKind::kRamp;
  lanes.back().successors = {11};
  const LaneGraph graph(lanes);

  EXPECT_THAT(graph.node(5).yields_to, ElementsAre(1));
  EXPECT_THAT(graph.node(1).yields_to, IsEmpty());
}

TEST(LaneGraph, TrafficYieldsToACrossing) {
  auto lanes = crossroad();
  lanes[1].kind = LaneKind::kCrossing;

  EXPECT_THAT(LaneGraph(lanes).node(1).yields_to, ElementsAre(2));
}

TEST(LaneGraph, LanesThatPartAreInNoConflict) {
  auto lanes = straight_road(2, 1);
  lanes.push_back(crossroad_lane(5, {100.0, 0.0}, {200.0, 4.0}));
  lanes.back().predecessors = {1};

  EXPECT_THAT(LaneGraph(lanes).node(5).conflicts, IsEmpty());
}

TEST(LaneGraph, LanesWithinARadiusAreFound) {
  const LaneGraph graph(straight_road(5, 1));

  EXPECT_THAT(graph.within({150.0, 0.0}, 20.0), ElementsAre(11));
  EXPECT_THAT(graph.within({150.0, 0.0}, 60.0), ElementsAre(1, 11, 21));
  EXPECT_THAT(graph.within({-30.0, 0.0}, 20.0), IsEmpty());
}

TEST(LaneGraph, WrongMapIsRefusedByName) {
  auto unknown = straight_road(1, 1);
  unknown[0].successors = {7};
  EXPECT_THAT([&] { LaneGraph{unknown}; }, ::testing::ThrowsMessage<std::runtime_error>(
                                               "lane 1: its successor 7 is not in the map"));
  auto uneven = straight_road(1, 1);
  uneven[0].left_m.push_back({200.0, 1.75});
  EXPECT_THROW(LaneGraph{uneven}, std::runtime_error);
  auto twice = straight_road(1, 1);
  twice.push_back(twice[0]);
  EXPECT_THROW(LaneGraph{twice}, std::runtime_error);
}

TEST(CommonRoadLanes, StopSignWithoutALineIsAtTheLanesEnd) {
  for (const auto& [name, is_stop] :
       {std::pair("206", true), std::pair("R1-1", true), std::pair("205", false)}) {
    Scenario scenario;
    scenario.lanelets[1] = {.id = 1,
                            .left_m = {{0.0, 3.0}, {10.0, 3.0}},
                            .right_m = {{0.0, 0.0}, {10.0, 0.0}},
                            .signs = {9}};
    scenario.signs[9] = {.id = 9, .elements = {{.sign = name}}};

    const MapLane lane = lanes_of(scenario).at(0);

    EXPECT_EQ(lane.has_stop_sign, is_stop) << name;
    EXPECT_EQ(lane.priority, -1) << name;
    ASSERT_EQ(lane.stop_line.has_value(), is_stop) << name;
    if (is_stop) {
      EXPECT_EQ(lane.stop_line->at(0), Eigen::Vector2d(10.0, 3.0));
      EXPECT_EQ(lane.stop_line->at(1), Eigen::Vector2d(10.0, 0.0));
    }
  }
}

// Six lanes, of which the right one leaves the road.
TEST(LaneGraph, LanesOfARecordedHighwayLieSideBySide) {
  const auto file = std::filesystem::path(ADS_DIR) / "data/commonroad/USA_US101-23_1_T-1.xml";
  const LaneGraph graph(lanes_of(Scenario::read(file)));

  EXPECT_EQ(graph.nodes().size(), 18U);
  std::map<std::size_t, int> widths;
  for (const auto& [id, node] : graph.nodes()) {
    ++widths[graph.beside(id).size()];
    EXPECT_THAT(node.yields_to, IsEmpty());
  }
  EXPECT_THAT(widths,
              ElementsAre(::testing::Pair(1U, 1), ::testing::Pair(5U, 5), ::testing::Pair(6U, 12)));
}

// A scene of a city, under a license of its own and so not shipped.
TEST(LaneGraph, IntersectionsOfACityHaveConflictsAndRightOfWay) {
  const char* const data = std::getenv("FASTCYCLE_DATA");
  const auto path =
      std::filesystem::path(data == nullptr ? "" : data) / "commonroad/USA_Peach-2_1_T-1.xml";
  if (data == nullptr || !std::filesystem::exists(path)) {
    GTEST_SKIP() << "FASTCYCLE_DATA names no folder with commonroad/USA_Peach-2_1_T-1.xml";
  }
  const LaneGraph graph(lanes_of(Scenario::read(path)));

  std::size_t conflicts = 0;
  std::size_t yields = 0;
  for (const auto& [id, node] : graph.nodes()) {
    conflicts += node.conflicts.size();
    yields += node.yields_to.size();
    for (const std::int64_t other : node.yields_to) {
      EXPECT_THAT(graph.node(other).yields_to, ::testing::Not(::testing::Contains(id)));
    }
  }
  EXPECT_GT(conflicts, 20U);
  EXPECT_GT(yields, 10U);
  EXPECT_LE(2 * yields, conflicts);
}

}  // namespace
}  // namespace ads

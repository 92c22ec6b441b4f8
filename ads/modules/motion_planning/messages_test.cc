#include "messages.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace motion_planning {
namespace {

hd_map::Route straight_route() {
  hd_map::Route route;
  route.set_is_found(true);
  for (double x = 0.0; x <= 100.0; x += 5.0) {
    route.mutable_reference()->add_x_m(x);
    route.mutable_reference()->add_y_m(0.0);
    route.add_left_edge_m(5.25);
    route.add_right_edge_m(1.75);
    route.add_speed_limit_mps(15.0);
  }
  return route;
}

hd_map::Tile tile_with_lane(std::int64_t id, double y_m) {
  hd_map::Tile tile;
  hd_map::Lane& lane = *tile.add_lanes();
  lane.set_id(id);
  for (const double x : {0.0, 50.0, 100.0}) {
    lane.mutable_left()->add_x_m(x);
    lane.mutable_left()->add_y_m(y_m + 1.75);
    lane.mutable_right()->add_x_m(x);
    lane.mutable_right()->add_y_m(y_m - 1.75);
  }
  return tile;
}

prediction::Predictions one_car() {
  prediction::Predictions predictions;
  prediction::PredictedObject& predicted = *predictions.add_objects();
  predicted.mutable_object()->set_is_relevant(true);
  perception::Object& object = *predicted.mutable_object()->mutable_object();
  object.set_id(7);
  object.set_length_m(4.5);
  object.set_width_m(1.8);
  prediction::Hypothesis& hypothesis = *predicted.add_hypotheses();
  hypothesis.set_probability(1.0);
  for (int index = 0; index < 3; ++index) {
    prediction::Point& point = *hypothesis.add_points();
    point.set_time_s(0.5 * index);
    point.set_x_m(5.0 * index);
    point.set_speed_mps(10.0);
  }
  return predictions;
}

std::optional<Goal> goal_from(const mission::Goal& goal, const hd_map::Tile* tile = nullptr,
                              const Road& road = {}) {
  return goal_of(goal, tile, road, [](std::int64_t ns) { return 1e-9 * static_cast<double>(ns); });
}

TEST(Messages, LanesGoOnToEachOfTheirSuccessors) {
  hd_map::Tile tile = tile_with_lane(1, 0.0);
  tile.mutable_lanes(0)->add_successors(2);
  tile.mutable_lanes(0)->add_successors(3);
  for (const std::int64_t id : {2, 3}) {
    hd_map::Lane& lane = *tile.add_lanes();
    lane.set_id(id);
    lane.add_predecessors(1);
    lane.add_successors(id);  // A circle ends somewhere.
    for (const double x : {100.0, 150.0}) {
      const double y = id == 2 ? 0.0 : -0.1 * (x - 100.0);
      lane.mutable_left()->add_x_m(x);
      lane.mutable_left()->add_y_m(y + 1.75);
      lane.mutable_right()->add_x_m(x);
      lane.mutable_right()->add_y_m(y - 1.75);
    }
  }

  const std::vector<Road> lanes = lanes_of(tile);

  ASSERT_EQ(lanes.size(), 2U);
  EXPECT_NEAR(lanes[0].length_m(), 150.0, 2.0);
  EXPECT_NEAR(lanes[1].length_m(), 150.0, 2.0);
  EXPECT_NEAR(std::abs(lanes[0].pose(148.0, 0.0).y_m - lanes[1].pose(148.0, 0.0).y_m), 4.8, 0.5);
}

TEST(Messages, RoadHasTheRoutesEdgesAndTheTilesLanes) {
  const hd_map::Tile tile = tile_with_lane(1, 3.5);
  const Road road = road_of(straight_route(), &tile);

  EXPECT_EQ(road.left_edge_m(50.0), 5.25);
  EXPECT_EQ(road.right_edge_m(50.0), 1.75);
  EXPECT_EQ(road.speed_limit_mps(50.0), 15.0);
  EXPECT_NEAR(road.lane_m(50.0, 3.0), 3.5, 1e-9);
}

TEST(Messages, RouteWithoutALineIsAnEmptyRoad) {
  EXPECT_TRUE(road_of(hd_map::Route(), nullptr).is_empty());
}

TEST(Messages, PredictionsBeginWhenTheirObjectsWereSeen) {
  const auto objects = objects_of(one_car(), 0.1);

  ASSERT_EQ(objects.size(), 1U);
  EXPECT_EQ(objects[0].id, 7U);
  EXPECT_NEAR(state_at(objects[0].ways.at(0), 0.0).x_m, 1.0, 1e-9);
}

TEST(Messages, ObjectThatDoesNotMatterIsLeftOut) {
  prediction::Predictions predictions = one_car();
  predictions.mutable_objects(0)->mutable_object()->set_is_relevant(false);

  EXPECT_TRUE(objects_of(predictions, 0.0).empty());
}

TEST(Messages, WhatIsNoNumberIsLeftOut) {
  prediction::Predictions predictions = one_car();
  predictions.mutable_objects(0)->mutable_hypotheses(0)->mutable_points(1)->set_x_m(
      std::numeric_limits<double>::quiet_NaN());

  EXPECT_TRUE(objects_of(predictions, 0.0).empty());
}

TEST(Messages, HazardsThatAreOverAreLeftOut) {
  prediction::Predictions predictions;
  predictions.add_hazards()->set_valid_until_ns(10);
  predictions.add_hazards()->set_is_cancelled(true);
  predictions.add_hazards()->set_speed_limit_mps(5.0);
  const auto hazards = hazards_of(predictions, 20);

  ASSERT_EQ(hazards.size(), 1U);
  EXPECT_EQ(hazards[0].speed_mps, 5.0);
}

TEST(Messages, MapEndsWhereTheLastLaneOfTheRoadHasNoSuccessor) {
  const Road road({{.x_m = 0.0, .y_m = 0.0}, {.x_m = 300.0, .y_m = 0.0}});
  hd_map::Tile tile = tile_with_lane(1, 0.0);
  EXPECT_NEAR(map_end_of(tile, road).value_or(0.0), 100.0, 0.1);

  *tile.add_lanes() = tile_with_lane(2, -3.5).lanes(0);  // Beside the road.
  tile.mutable_lanes(0)->add_successors(3);              // In another tile.
  EXPECT_FALSE(map_end_of(tile, road));
  EXPECT_FALSE(map_end_of(hd_map::Tile(), road));
}

TEST(Messages, GoalIsARectangleWithIntervals) {
  mission::Goal message;
  message.mutable_rectangle()->set_x_m(30.0);
  message.mutable_rectangle()->set_length_m(2.0);
  message.mutable_rectangle()->set_width_m(1.6);
  message.mutable_speed_mps()->set_high(3.0);
  message.set_window_begin_ns(1'000'000'000);
  message.set_window_end_ns(2'000'000'000);
  const auto goal = goal_from(message);

  ASSERT_TRUE(goal);
  EXPECT_EQ(goal->half_width_m, 0.8);
  EXPECT_EQ(goal->speed_mps.high, 3.0);
  EXPECT_EQ(goal->time_s.low, 1.0);
  EXPECT_TRUE(std::isinf(goal->heading_rad.high));
}

TEST(Messages, GoalOnALaneIsInItsMiddle) {
  mission::Goal message;
  message.add_lanes(1);
  const hd_map::Tile tile = tile_with_lane(1, 3.5);
  const auto goal = goal_from(message, &tile);

  ASSERT_TRUE(goal);
  EXPECT_NEAR(goal->centre.x_m, 50.0, 1e-9);
  EXPECT_NEAR(goal->centre.y_m, 3.5, 1e-9);
  EXPECT_NEAR(goal->half_length_m, 50.0, 1e-9);
  EXPECT_FALSE(goal_from(message));
}

TEST(Messages, GoalOnLanesOfTheRoadIsTheStretchAlongThem) {
  // Around a quarter of a circle, in two lanes of which one follows the other.
  hd_map::Tile tile;
  std::vector<RoadPoint> points;
  for (double turn = 0.0; turn < 1.6; turn += 0.05) {
    points.push_back({.x_m = 40.0 * std::sin(turn), .y_m = 40.0 * (1.0 - std::cos(turn))});
  }
  for (const int part : {1, 2}) {
    hd_map::Lane& lane = *tile.add_lanes();
    lane.set_id(part);
    for (int step = 0; step <= 10; ++step) {
      const double turn = 0.4 * part + 0.04 * step;
      lane.mutable_left()->add_x_m(38.25 * std::sin(turn));
      lane.mutable_left()->add_y_m(40.0 - 38.25 * std::cos(turn));
      lane.mutable_right()->add_x_m(41.75 * std::sin(turn));
      lane.mutable_right()->add_y_m(40.0 - 41.75 * std::cos(turn));
    }
  }
  mission::Goal message;
  message.add_lanes(2);
  message.add_lanes(1);
  const auto goal = goal_from(message, &tile, Road(points));

  ASSERT_TRUE(goal && goal->on_road);
  EXPECT_NEAR(goal->on_road->middle_m(), 0.8 * 40.0, 1.0);
  EXPECT_NEAR(goal->on_road->offset_m(20.0), 0.0, 0.1);
  EXPECT_NEAR(goal->half_length_m, 0.4 * 40.0, 1.0);
  EXPECT_NEAR(goal->half_width_m, 1.75, 0.01);
}

TEST(Messages, TrajectoryIsWrittenWithItsTimes) {
  planning::Trajectory message;
  const Trajectory trajectory{.states = {{.x_m = 1.0, .steering_rad = 0.1}, {.x_m = 2.0}}};
  write(Vehicle{}, trajectory, 5, message);

  EXPECT_EQ(message.start_ns(), 5);
  ASSERT_EQ(message.points_size(), 2);
  EXPECT_NEAR(message.points(0).curvature_per_m(), std::tan(0.1) / 2.58, 1e-12);
  EXPECT_NEAR(message.points(1).time_s(), 0.1, 1e-12);
}

hd_map::Tile tile_with_stop_line(std::int64_t lane, double x_m, double y_m) {
  hd_map::Tile tile = tile_with_lane(lane, y_m);
  hd_map::Line& line = *tile.mutable_lanes(0)->mutable_stop_line();
  line.add_x_m(x_m);
  line.add_y_m(y_m + 1.75);
  line.add_x_m(x_m);
  line.add_y_m(y_m - 1.75);
  return tile;
}

TEST(Messages, StopLineOfTheLaneThatTheRoadFollowsIsToWaitAt) {
  hd_map::Route route = straight_route();
  route.add_sections()->add_lanes(1);
  hd_map::Tile tile = tile_with_stop_line(1, 70.0, 0.0);
  const Road road = road_of(route, &tile);
  const WaitingLine line{.lane = 1, .along_m = 70.0, .is_stop_sign = false};

  EXPECT_EQ(waiting_lines_of(route, tile, road), std::vector{line});
  tile.mutable_lanes(0)->set_has_stop_sign(true);
  ASSERT_EQ(waiting_lines_of(route, tile, road).size(), 1U);
  EXPECT_TRUE(waiting_lines_of(route, tile, road)[0].is_stop_sign);

  // Those of lanes beside it, and of lanes that the route does not lead over, are others'.
  route.mutable_sections(0)->add_lanes(2);
  EXPECT_TRUE(waiting_lines_of(route, tile_with_stop_line(2, 70.0, 3.5), road).empty());
  EXPECT_TRUE(waiting_lines_of(route, tile_with_stop_line(3, 70.0, 0.0), road).empty());
}

TEST(Messages, BindingRulesAreWrittenAsTheyAre) {
  google::protobuf::RepeatedPtrField<planning::BindingRule> messages;
  write({{.rule = {.kind = RuleKind::kGiveWay, .along_m = 30.0, .object = 7},
          .place = {.x_m = 1.0, .y_m = 2.0},
          .ahead_m = 20.0,
          .time_s = 1.5},
         {.rule = {.kind = RuleKind::kSpeedLimit, .speed_mps = 13.9}}},
        messages);

  ASSERT_EQ(messages.size(), 2);
  EXPECT_EQ(messages[0].kind(), planning::BindingRule::GIVE_WAY);
  EXPECT_EQ(messages[0].speed_mps(), 0.0);
  EXPECT_EQ(messages[0].x_m(), 1.0);
  EXPECT_EQ(messages[0].y_m(), 2.0);
  EXPECT_EQ(messages[0].ahead_m(), 20.0);
  EXPECT_EQ(messages[0].time_s(), 1.5);
  EXPECT_EQ(messages[0].object(), 7U);
  EXPECT_EQ(messages[1].kind(), planning::BindingRule::SPEED_LIMIT);
  EXPECT_EQ(messages[1].speed_mps(), 13.9);
}

}  // namespace
}  // namespace motion_planning

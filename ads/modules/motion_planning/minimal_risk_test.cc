#include "minimal_risk.h"

#include <cmath>

#include <gtest/gtest.h>

#include "straight_road.h"

namespace motion_planning {
namespace {

constexpr std::size_t kSteps = 60;

Stop stop_among(const std::vector<TrafficObject>& objects, double speed_mps) {
  const Vehicle vehicle;
  const Road road = straight_road();
  const Traffic traffic(objects, kSteps);
  const Problem problem{.vehicle = vehicle,
                        .road = road,
                        .traffic = traffic,
                        .start = {.speed_mps = speed_mps},
                        .goal = {},
                        .slow_stretches = {}};
  Trajectory straight;
  State state = problem.start;
  for (int count = 0; count < 20; ++count) {
    straight.states.push_back(state);
    state = drive(vehicle, state, {}, straight.step_s);
  }
  return stop_along(problem, traffic, straight);
}

TEST(MinimalRisk, StopsMildlyOnAFreeRoad) {
  const Stop stop = stop_among({}, 15.0);

  EXPECT_EQ(stop.braking_mps2, 2.0);
  EXPECT_TRUE(std::isinf(stop.hit_s));
  EXPECT_EQ(stop.trajectory.states.back().speed_mps, 0.0);
  EXPECT_NEAR(stop.trajectory.states.back().x_m, 15.0 * 15.0 / 4.0, 3.0);
}

TEST(MinimalRisk, BrakesHarderForWhatStandsAhead) {
  const Stop stop = stop_among({car(35.0, 0.0, 0.0)}, 15.0);

  EXPECT_GT(stop.braking_mps2, 3.0);
  EXPECT_TRUE(std::isinf(stop.hit_s));
  EXPECT_LT(stop.trajectory.states.back().x_m, 35.0 - 4.5);
}

TEST(MinimalRisk, SaysWhenNothingHelps) {
  const Stop stop = stop_among({car(10.0, 0.0, 0.0)}, 15.0);

  EXPECT_GE(stop.braking_mps2, 6.0) << "the slower, the better";
  EXPECT_LT(stop.hit_s, 1.0);
}

TEST(MinimalRisk, BrakesSoThatWhoIsBehindCanBrakeAsWell) {
  // It would take 6 m/s^2 with nobody behind.
  const std::vector<TrafficObject> ahead = {car(29.0, 0.0, 0.0, 1)};
  const Stop alone = stop_among(ahead, 15.0);
  const Stop followed = stop_among({car(-22.0, 0.0, 15.0, 2)}, 15.0);

  EXPECT_GE(alone.braking_mps2, 5.0);
  EXPECT_LE(followed.braking_mps2, 4.0);
}

// Stops on lanes along y = 0 and y = -3.5 m.
State end_of_safest_stop(const std::vector<TrafficObject>& objects) {
  const Vehicle vehicle;
  const Road road = straight_road();
  std::vector<Road> lanes;
  for (const double offset : {0.0, -kLane_m}) {
    std::vector<RoadPoint> points;
    for (double x = -50.0; x <= 400.0; x += 5.0) {
      points.push_back({.x_m = x, .y_m = offset, .left_edge_m = 50.0, .right_edge_m = 50.0});
    }
    lanes.emplace_back(points);
  }
  const Traffic traffic(objects, kSteps);
  const Problem problem{.vehicle = vehicle,
                        .road = road,
                        .traffic = traffic,
                        .start = {.speed_mps = 15.0},
                        .lanes = &lanes};
  Trajectory straight;
  State state = problem.start;
  for (int count = 0; count < 20; ++count) {
    straight.states.push_back(state);
    state = drive(vehicle, state, {}, straight.step_s);
  }
  return safest_stop(problem, traffic, straight).trajectory.states.back();
}

TEST(MinimalRisk, StopsInItsLaneWhenNobodyComes) {
  EXPECT_NEAR(end_of_safest_stop({}).y_m, 0.0, 0.1);
}

TEST(MinimalRisk, LeavesTheLaneToWhoComesFromBehindAndDoesNotBrake) {
  const State end = end_of_safest_stop({car(-13.0, 0.0, 15.0)});

  EXPECT_NEAR(end.y_m, -kLane_m, 0.4);
  EXPECT_EQ(end.speed_mps, 0.0);
}

TEST(MinimalRisk, StaysInItsLaneWhenSomebodyComesOnTheOtherAsWell) {
  const std::vector<TrafficObject> behind = {car(-13.0, 0.0, 15.0, 1),
                                             car(-13.0, -kLane_m, 15.0, 2)};

  EXPECT_NEAR(end_of_safest_stop(behind).y_m, 0.0, 0.4);
}

TEST(MinimalRisk, LeavesTheLaneEvenIfSomebodyMightPerhapsGoThereToo) {
  TrafficObject beside = car(-13.0, kLane_m, 15.0, 2);
  PredictedWay into_the_free_lane = beside.ways.front();
  for (int step = 1; step <= 20; ++step) {
    PredictedState& state =
        into_the_free_lane.states.emplace_back(into_the_free_lane.states.front());
    state.x_m += 1.5 * step;
    state.y_m -= 2.0 * kLane_m * std::min(1.0, 0.1 * step);
  }
  into_the_free_lane.probability = 0.25;
  beside.ways.front().probability = 0.75;
  beside.ways.push_back(into_the_free_lane);

  EXPECT_NEAR(end_of_safest_stop({car(-13.0, 0.0, 15.0, 1), beside}).y_m, -kLane_m, 0.4);
}

TEST(MinimalRisk, StaysWhereItStands) {
  const Stop stop = stop_among({}, 0.0);

  EXPECT_EQ(stop.trajectory.states.back().x_m, 0.0);
  EXPECT_GE(stop.trajectory.duration_s(), 0.5);
}

}  // namespace
}  // namespace motion_planning

#include "trajectory.h"

#include <cmath>

#include <gtest/gtest.h>

#include "straight_road.h"

namespace motion_planning {
namespace {

constexpr std::size_t kSteps = 20;

// At 10 m/s along the road, from x = 0 m.
Trajectory straight_on() {
  Trajectory trajectory{.start_s = 0.0, .step_s = 0.1};
  for (int step = 0; step <= 40; ++step) {
    trajectory.states.push_back({.x_m = 1.0 * step, .speed_mps = 10.0});
  }
  return trajectory;
}

// A car that may stand on the road or beside it.
TrafficObject perhaps_in_the_way(double probability) {
  TrafficObject object = car(20.0, 0.0, 0.0);
  object.ways[0].probability = probability;
  object.ways.push_back({.probability = 1.0 - probability, .states = {{.x_m = 20.0, .y_m = 5.0}}});
  return object;
}

Verdict verdict_of(const TrafficObject& object) {
  return judge(Vehicle(), straight_on(), Traffic({object}, kSteps), 4.0);
}

// From 2 m/s with -2 m/s^2: reverses from 1 s on; then with 4 m/s^2 forward again from 3 s on.
Way that_reverses(const Vehicle& vehicle) {
  Way way{.states = {{.speed_mps = 2.0, .acceleration_mps2 = -2.0, .steering_rad = 0.3}}};
  for (int step = 0; step < 20; ++step) {
    const double jerk = step == 9 ? 6.0 / kStep_s : 0.0;
    way.inputs.push_back({.jerk_mps3 = jerk});
    way.states.push_back(drive(vehicle, way.states.back(), way.inputs.back(), kStep_s));
  }
  return way;
}

TEST(TrajectoryOf, AWayThatReversesStandsInstead) {
  const Vehicle vehicle;
  const Way way = that_reverses(vehicle);
  ASSERT_LT(way.states[9].speed_mps, -1.0);
  ASSERT_GT(way.states.back().speed_mps, 3.0);

  const Trajectory trajectory = trajectory_of(vehicle, way, 0.0);

  for (std::size_t index = 0; index + 1 < trajectory.states.size(); ++index) {
    const State& from = trajectory.states[index];
    const State& to = trajectory.states[index + 1];
    EXPECT_GE(to.speed_mps, 0.0);
    const double forward = (to.x_m - from.x_m) * std::cos(from.heading_rad) +
                           (to.y_m - from.y_m) * std::sin(from.heading_rad);
    const double expected = 0.5 * trajectory.step_s * (from.speed_mps + to.speed_mps);
    EXPECT_NEAR(forward, expected, 0.01) << index;
  }
  EXPECT_GT(trajectory.states.back().speed_mps, 3.0);
}

TEST(TrajectoryOf, KeepsTheStatesOfAWayThatDrivesForward) {
  const Vehicle vehicle;
  Way way = that_reverses(vehicle);
  way.states.resize(5);
  way.inputs.resize(4);
  ASSERT_GT(way.states.back().speed_mps, 0.0);

  const Trajectory trajectory = trajectory_of(vehicle, way, 0.0);

  for (std::size_t index = 0; index < way.states.size(); ++index) {
    EXPECT_EQ(trajectory.states[2 * index], way.states[index]);
  }
}

TEST(Judge, SaysWhenAndHowFastSomethingIsTouched) {
  const Verdict verdict = verdict_of(car(20.0, 0.0, 4.0));

  EXPECT_NEAR(verdict.hit_s, (20.0 - 4.5) / 6.0, kStep_s);
  EXPECT_NEAR(verdict.hit_mps, 6.0, 1e-9);
  EXPECT_EQ(verdict.smallest_gap_m, 0.0);
}

TEST(Judge, WayThatIsNotProbableDoesNotCount) {
  EXPECT_TRUE(std::isfinite(verdict_of(perhaps_in_the_way(0.2)).hit_s));
  EXPECT_FALSE(std::isfinite(verdict_of(perhaps_in_the_way(0.12)).hit_s));
}

TEST(Judge, WaysOfAnObjectThatTouchTheVehicleCountTogether) {
  TrafficObject object = perhaps_in_the_way(0.12);
  object.ways.push_back(object.ways[0]);
  object.ways.back().states[0].y_m = 0.3;

  const Verdict verdict = verdict_of(object);

  EXPECT_TRUE(std::isfinite(verdict.hit_s));
  EXPECT_EQ(verdict.smallest_gap_m, 0.0);
}

TEST(Judge, WaysOfDifferentObjectsDoNotCountTogether) {
  const TrafficObject object = perhaps_in_the_way(0.12);

  EXPECT_FALSE(
      std::isfinite(judge(Vehicle(), straight_on(), Traffic({object, object}, kSteps), 4.0).hit_s));
}

}  // namespace
}  // namespace motion_planning

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

TEST(Judge, SaysWhenAndHowFastSomethingIsTouched) {
  const Verdict verdict = verdict_of(car(20.0, 0.0, 4.0));

  EXPECT_NEAR(verdict.hit_s, (20.0 - 4.5) / 6.0, Traffic::kStep_s);
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

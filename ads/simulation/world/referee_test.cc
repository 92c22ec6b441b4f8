#include "referee.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "small_scenario.h"

namespace ads {
namespace {

using testing::SmallScenario;

Body body(std::int64_t id, double x_m, double y_m) {
  return {.id = id, .box = {.center_m = {x_m, y_m}, .length_m = 4.0, .width_m = 2.0}};
}

EgoState ego(double x_m, double y_m = 0.0, double speed_mps = 10.0, double heading_rad = 0.0) {
  return {.center_m = {x_m, y_m}, .heading_rad = heading_rad, .speed_mps = speed_mps};
}

void watch(Referee& referee, double time_s, const EgoState& state, std::vector<Body> bodies) {
  referee.watch(time_s, 0.01, state, EgoModel(EgoLimits(), state).box(), bodies);
}

TEST(Referee, GoalIsReachedWhenAllConditionsHoldAtOneStep) {
  const Scenario scenario =
      SmallScenario()
          .goal(50.0, 40, 50,
                "<orientation><intervalStart>-0.1</intervalStart><intervalEnd>0.1</intervalEnd>"
                "</orientation><velocity><intervalStart>8</intervalStart><intervalEnd>12"
                "</intervalEnd></velocity>")
          .scenario();
  Referee referee(scenario);

  referee.judge_step(39, ego(50.0));                    // too early
  referee.judge_step(40, ego(47.9));                    // not there yet
  referee.judge_step(41, ego(50.0, 1.6));               // beside it
  referee.judge_step(42, ego(50.0, 0.0, 7.9));          // too slow
  referee.judge_step(43, ego(50.0, 0.0, 10.0, -0.11));  // at a slant
  EXPECT_FALSE(referee.is_goal_reached());
  referee.judge_step(44, ego(48.0, 1.5, 8.0, 0.1));
  EXPECT_TRUE(referee.is_goal_reached());
  referee.judge_step(45, ego(50.0));

  EXPECT_DOUBLE_EQ(referee.goal_time_s().value(), 4.4);
  EXPECT_EQ(referee.verdict(), "reached the goal at 4.4 s");
}

TEST(Referee, ConditionsThatHoldAtDifferentTimesAreNotEnough) {
  const Scenario scenario =
      SmallScenario()
          .goal(50.0, 40, 50,
                "<velocity><intervalStart>0</intervalStart><intervalEnd>3</intervalEnd></velocity>")
          .scenario();
  Referee referee(scenario);

  referee.judge_step(40, ego(30.0, 0.0, 2.0));
  referee.judge_step(45, ego(50.0, 0.0, 4.5));
  referee.judge_step(50, ego(60.0, 0.0, 2.0));

  EXPECT_EQ(referee.verdict(), "failed: missed the goal, by least at 4.5 s: 1.50 m/s too fast");
}

TEST(Referee, AnyOfSeveralGoalsWillDo) {
  const Scenario scenario = SmallScenario().goal(50.0, 40, 50).goal(90.0, 60, 70).scenario();
  Referee referee(scenario);

  referee.judge_step(45, ego(90.0));
  EXPECT_FALSE(referee.is_goal_reached());
  referee.judge_step(65, ego(90.0));

  EXPECT_TRUE(referee.is_goal_reached());
  EXPECT_EQ(referee.window_end_s(), 7.0);
}

TEST(Referee, GoalMayBeLanesCirclesAndPolygons) {
  Scenario scenario = SmallScenario().goal(0.0, 0, 100).scenario();
  GoalState& goal = scenario.problems.front().goals.front();
  goal.boxes.clear();
  goal.lanelets = {2, 999};
  goal.circles = {{.center_m = {50.0, -20.0}, .radius_m = 2.0}};
  goal.polygons = {{{0.0, -10.0}, {4.0, -10.0}, {0.0, -6.0}}};
  const auto is_reached = [&](double x_m, double y_m) {
    Referee referee(scenario);
    referee.judge_step(1, ego(x_m, y_m));
    return referee.is_goal_reached();
  };

  EXPECT_TRUE(is_reached(10.0, 3.0));
  EXPECT_TRUE(is_reached(51.0, -21.0));
  EXPECT_TRUE(is_reached(1.0, -9.0));
  EXPECT_FALSE(is_reached(10.0, 0.0));
  EXPECT_FALSE(is_reached(52.0, -22.0));
  EXPECT_FALSE(is_reached(3.0, -7.0));
}

TEST(Referee, HeadingsCountAroundTheTurn) {
  Scenario scenario = SmallScenario().goal(0.0, 0, 100).scenario();
  const auto is_reached = [&](double low, double high, double heading_rad) {
    scenario.problems.front().goals.front().heading_rad = Interval{.low = low, .high = high};
    Referee referee(scenario);
    referee.judge_step(1, ego(0.0, 0.0, 10.0, heading_rad));
    return referee.is_goal_reached();
  };

  EXPECT_TRUE(is_reached(-3.3, -3.0, 3.1));
  EXPECT_TRUE(is_reached(3.0, 3.4, -3.1));
  EXPECT_FALSE(is_reached(3.0, 3.4, -2.8));
  EXPECT_FALSE(is_reached(-0.1, 0.1, std::numbers::pi));
  EXPECT_TRUE(is_reached(6.2, 6.4, 0.05));
}

TEST(Referee, EveryBodyThatIsTouchedIsReportedOnce) {
  const Scenario scenario = SmallScenario().goal(50.0, 40, 50).scenario();
  Referee referee(scenario);

  watch(referee, 0.0, ego(0.0), {body(1, 10.0, 0.0), body(2, 0.0, 3.5)});
  watch(referee, 0.5, ego(6.0), {body(1, 10.0, 0.0), body(2, 3.0, 3.5)});
  watch(referee, 0.6, ego(7.0), {body(1, 10.0, 0.0), body(2, 3.0, 3.5)});
  watch(referee, 0.7, ego(9.0), {body(1, 10.0, 0.0), body(2, 6.0, 1.5)});

  ASSERT_EQ(referee.contacts().size(), 2U);
  EXPECT_EQ(referee.contacts()[0].id, 1);
  EXPECT_EQ(referee.contacts()[0].time_s, 0.5);
  EXPECT_EQ(referee.contacts()[0].ego_m.x(), 6.0);
  EXPECT_EQ(referee.contacts()[1].id, 2);
  EXPECT_EQ(referee.smallest_gap()->gap_m, 0.0);
  EXPECT_EQ(referee.verdict(),
            "failed: touched 1 at 0.50 s, at (6.0, 0.0); touched 2 at 0.70 s, at (9.0, 0.0); "
            "ended before the goal's window");
}

TEST(Referee, SmallestGapIsThatOfTheClosestBoxes) {
  const Scenario scenario = SmallScenario().goal(50.0, 40, 50).scenario();
  Referee referee(scenario);
  EXPECT_FALSE(referee.smallest_gap());

  watch(referee, 0.0, ego(0.0), {body(1, 10.0, 0.0), body(2, -20.0, 0.0)});
  watch(referee, 0.1, ego(0.0), {body(2, -2.0, 3.0)});
  watch(referee, 0.2, ego(0.0), {});

  EXPECT_EQ(referee.smallest_gap()->id, 2);
  EXPECT_EQ(referee.smallest_gap()->time_s, 0.1);
  EXPECT_NEAR(referee.smallest_gap()->gap_m, 3.0 - 1.0 - 0.805, 1e-12);
}

TEST(Referee, RoadIsWhereLanesAre) {
  const Scenario scenario = SmallScenario().goal(50.0, 0, 50).scenario();
  Referee referee(scenario);

  watch(referee, 1.0, ego(0.0, 1.75), {});
  watch(referee, 1.1, ego(0.0, 5.0), {});
  watch(referee, 1.15, ego(0.0, -1.79), {});
  EXPECT_EQ(referee.off_road_s(), 0.0) << "so wide are seams between lanes";
  watch(referee, 1.2, ego(0.0, -1.81), {});
  watch(referee, 1.3, ego(201.0, 0.0), {});
  referee.judge_step(20, ego(50.0));

  EXPECT_NEAR(referee.off_road_s(), 0.02, 1e-12);
  EXPECT_EQ(referee.verdict(), "failed: was off the road for 0.02 s, first at 1.20 s");
}

TEST(Referee, ExtremesOfAccelerationAreKept) {
  const Scenario scenario = SmallScenario().goal(50.0, 0, 50).scenario();
  Referee referee(scenario);
  EgoState state = ego(0.0);
  for (const double value : {0.5, -3.0, 2.0}) {
    state.acceleration_mps2 = value;
    state.yaw_rate_radps = value / 20.0;
    watch(referee, 1.0, state, {});
  }

  EXPECT_EQ(referee.extremes().acceleration_max_mps2, 2.0);
  EXPECT_EQ(referee.extremes().acceleration_min_mps2, -3.0);
  EXPECT_EQ(referee.extremes().lateral_acceleration_max_mps2, 1.5);
}

}  // namespace
}  // namespace ads

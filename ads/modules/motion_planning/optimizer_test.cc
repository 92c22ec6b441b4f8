#include "optimizer.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "straight_road.h"
#include "trajectory.h"

namespace motion_planning {
namespace {

constexpr std::size_t kSteps = 40;

class OptimizerTest : public ::testing::Test {
 protected:
  Problem problem() const {
    return {.vehicle = vehicle_,
            .road = road_,
            .traffic = traffic_,
            .start = {.speed_mps = 10.0},
            .goal = goal_,
            .slow_stretches = slow_,
            .cruise_mps = 10.0};
  }
  static Way straight_on() { return {.states = {}, .inputs = std::vector<Input>(kSteps)}; }

  Vehicle vehicle_;
  Road road_ = straight_road();
  Traffic traffic_{{}, kSteps};
  std::optional<Goal> goal_;
  std::vector<SlowStretch> slow_;
};

TEST_F(OptimizerTest, LeavesAloneWhatIsGood) {
  const Problem given = problem();
  const Way way = Optimizer(given).improve(straight_on());

  EXPECT_LT(way.cost, 1e-6);
  EXPECT_NEAR(way.states.back().x_m, 80.0, 1e-3);
}

TEST_F(OptimizerTest, FollowsAGuess) {
  std::vector<Pose> guess;
  for (std::size_t step = 1; step <= kSteps; ++step) {
    const double time = kStep_s * static_cast<double>(step);
    guess.push_back({.x_m = 10.0 * time, .y_m = kLane_m * std::min(1.0, time / 4.0)});
  }
  const Problem given = problem();
  const Way way = Optimizer(given).follow(guess);

  EXPECT_NEAR(way.states.back().x_m, 80.0, 0.5);
  EXPECT_NEAR(way.states.back().y_m, kLane_m, 0.2);
}

TEST_F(OptimizerTest, WholeBodyStaysOnTheRoadInABend) {
  // 3.5 m wide, around a quarter of a circle with a radius of 9 m.
  std::vector<RoadPoint> points;
  const auto add = [&](double x, double y) {
    points.push_back({.x_m = x, .y_m = y, .left_edge_m = 1.75, .right_edge_m = 1.75});
  };
  for (double x = -20.0; x < 12.0; x += 1.0) {
    add(x, 0.0);
  }
  for (double turn = 0.0; turn < 1.57; turn += 0.1) {
    add(12.0 + 9.0 * std::sin(turn), 9.0 - 9.0 * std::cos(turn));
  }
  for (double y = 9.0; y < 80.0; y += 1.0) {
    add(21.0, y);
  }
  road_ = Road(points);
  std::vector<Pose> guess;
  for (std::size_t step = 1; step <= kSteps; ++step) {
    guess.push_back(road_.pose(20.0 + 1.0 * static_cast<double>(step), 0.0));
  }
  Problem given = problem();
  given.start.speed_mps = 5.0;
  given.cruise_mps = 5.0;
  Optimizer optimizer(given);
  const Way way = optimizer.improve(optimizer.follow(guess));

  EXPECT_GT(way.states.back().y_m, 9.0);
  EXPECT_LT(over_edge_m(vehicle_, trajectory_of(vehicle_, way, 0.0), road_, 8.0), 0.0 + 1e-9);
}

TEST_F(OptimizerTest, DrivesAtTheLimitOfTheRoad) {
  road_ = straight_road(8.0);
  const Problem given = problem();
  const Way way = Optimizer(given).improve(straight_on());

  EXPECT_NEAR(way.states.back().speed_mps, 8.0, 0.7);
}

TEST_F(OptimizerTest, LimitHoldsAgainstAGoalThatNeedsMore) {
  road_ = straight_road(10.0);
  goal_ = Goal{.centre = {.x_m = 100.0},
               .half_length_m = 1.0,
               .half_width_m = 0.8,
               .speed_mps = {12.0, 16.0},
               .time_s = {6.0, 7.0}};
  const Problem given = problem();
  const Way way = Optimizer(given).improve(straight_on());

  for (const State& state : way.states) {
    EXPECT_LT(state.speed_mps, 10.0 + SpeedProfile::kTolerance_mps) << state.x_m;
  }
}

TEST_F(OptimizerTest, MoreThanTheLimitIsForEmergencies) {
  road_ = straight_road(10.0);
  traffic_ = Traffic({car(-12.0, 0.0, 13.0)}, kSteps);
  Problem given = problem();
  given.is_emergency = true;
  const Way way = Optimizer(given).improve(straight_on());

  EXPECT_GT(std::ranges::max(way.states, {}, &State::speed_mps).speed_mps, 10.5);
}

TEST_F(OptimizerTest, StopsBeforeAHalt) {
  Problem given = problem();
  given.halt = Halt{.along_m = 90.0};  // x = 40 m.
  const Way way = Optimizer(given).improve(straight_on());

  EXPECT_LT(way.states.back().x_m, 40.3);
  EXPECT_GT(way.states.back().x_m, 35.0);
  EXPECT_LT(way.states.back().speed_mps, 1.5);
}

TEST_F(OptimizerTest, GoalAlongTheRoadIsReachedAnywhereOnIt) {
  goal_ =
      Goal{.centre = {.x_m = 60.0},
           .half_length_m = 30.0,
           .half_width_m = 1.75,
           .time_s = {6.0, 7.0},
           .on_road = GoalStretch{.begin_m = 80.0, .offsets_m = std::vector<double>(61, kLane_m)}};
  const Problem given = problem();
  const Way way = Optimizer(given).improve(straight_on());

  EXPECT_NEAR(way.states[33].y_m, kLane_m, 0.7);
}

TEST_F(OptimizerTest, MeetsTheGoalState) {
  goal_ = Goal{.centre = {.x_m = 70.0, .y_m = 1.0, .heading_rad = 0.05},
               .half_length_m = 1.0,
               .half_width_m = 0.8,
               .heading_rad = {0.03, 0.2},
               .speed_mps = {8.0, 14.0},
               .time_s = {6.0, 7.0}};
  const Problem given = problem();
  const Way way = Optimizer(given).improve(straight_on());
  const Trajectory trajectory = trajectory_of(vehicle_, way, 0.0);
  double nearest = 1e9;
  for (double time = 6.0; time <= 7.0; time += 0.01) {
    const State state = trajectory.at(time);
    if (state.heading_rad > 0.03 && std::abs(state.y_m - 1.0) < 0.7) {
      nearest = std::min(nearest, std::abs(state.x_m - 70.0));
    }
  }

  EXPECT_LT(nearest, 0.5);
}

TEST_F(OptimizerTest, PassesASlowerCarWithRoomBetween) {
  traffic_ = Traffic({car(30.0, 0.0, 6.0)}, kSteps);
  const Problem given = problem();
  const Way way = Optimizer(given).improve(straight_on());
  const Verdict verdict = judge(vehicle_, trajectory_of(vehicle_, way, 0.0), traffic_, 8.0);

  EXPECT_GT(verdict.smallest_gap_m, 0.7);
  EXPECT_GT(verdict.acceleration_min_mps2, -4.0);
}

TEST_F(OptimizerTest, MakesWayForACarThatComesFromBehind) {
  traffic_ = Traffic({car(-12.0, 0.0, 13.0)}, kSteps);
  const Problem given = problem();
  const Way way = Optimizer(given).improve(straight_on());
  const Verdict verdict = judge(vehicle_, trajectory_of(vehicle_, way, 0.0), traffic_, 8.0);

  EXPECT_GT(verdict.smallest_gap_m, 0.5);
  EXPECT_LE(verdict.acceleration_max_mps2, 4.0);
}

TEST_F(OptimizerTest, IsSlowWhereItIsAskedTo) {
  slow_ = {{.begin_m = 90.0, .end_m = 110.0, .speed_mps = 5.0}};  // x from 40 m to 60 m.
  const Problem given = problem();
  const Way way = Optimizer(given).improve(straight_on());

  for (const State& state : way.states) {
    EXPECT_TRUE(state.x_m < 41.0 || state.x_m > 59.0 || state.speed_mps < 5.5) << state.x_m;
  }
}

TEST_F(OptimizerTest, StaysWithinTheVehiclesLimits) {
  traffic_ = Traffic({car(12.0, 0.0, 0.0), car(12.0, kLane_m, 0.0)}, kSteps);
  const Problem given = problem();
  const Way way = Optimizer(given).improve(straight_on());

  for (const Input& input : way.inputs) {
    EXPECT_LE(std::abs(input.steering_rate_radps), vehicle_.steering_rate_max_radps);
  }
}

}  // namespace
}  // namespace motion_planning

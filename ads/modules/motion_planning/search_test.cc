#include "search.h"

#include <cmath>
#include <cstdlib>

#include <gtest/gtest.h>

#include "straight_road.h"

namespace motion_planning {
namespace {

constexpr std::size_t kSteps = 40;
constexpr std::size_t kBeam = 150;

// 8 s ahead, at about the start's speed.
Goal goal_at(double x_m, double y_m) {
  return {.centre = {.x_m = x_m, .y_m = y_m},
          .half_length_m = 1.0,
          .half_width_m = 0.8,
          .speed_mps = {7.0, 13.0},
          .time_s = {6.0, 7.0}};
}

Found found_for(const std::vector<TrafficObject>& objects, const std::optional<Goal>& goal,
                double speed_mps = 10.0, double acceleration_mps2 = 0.0,
                double speed_limit_mps = 0.0) {
  const Vehicle vehicle;
  const Road road = straight_road(speed_limit_mps);
  const Traffic traffic(objects, kSteps);
  const Problem problem{.vehicle = vehicle,
                        .road = road,
                        .traffic = traffic,
                        .start = {.speed_mps = speed_mps, .acceleration_mps2 = acceleration_mps2},
                        .goal = goal,
                        .slow_stretches = {},
                        .cruise_mps = speed_mps};
  return Search(problem, kBeam).run();
}

TEST(Search, KeepsItsLaneOnAFreeRoad) {
  const Found found = found_for({}, std::nullopt);

  ASSERT_EQ(found.poses.size(), kSteps);
  EXPECT_NEAR(found.poses.back().y_m, 0.0, 1e-9);
  EXPECT_NEAR(found.poses.back().x_m, 80.0, 2.0);
  EXPECT_EQ(found.candidates, found.feasible);
}

TEST(Search, ReachesAGoalInTheOtherLane) {
  const Found found = found_for({}, goal_at(65.0, kLane_m));

  EXPECT_TRUE(found.reaches_goal);
  EXPECT_NEAR(found.poses[31].y_m, kLane_m, 0.5);
}

TEST(Search, SaysThatAGoalIsTooFar) {
  EXPECT_FALSE(found_for({}, goal_at(180.0, 0.0)).reaches_goal);
}

TEST(Search, StopsAtAGoalThatItCouldPass) {
  const Vehicle vehicle;
  const Road road = straight_road(0.0);
  const Traffic traffic({}, 80);
  const Problem problem{
      .vehicle = vehicle,
      .road = road,
      .traffic = traffic,
      .start = {.speed_mps = 9.0},
      .goal = Goal{.centre = {.x_m = 8.0},
                   .half_length_m = 12.0,
                   .half_width_m = 2.0,
                   .time_s = {14.0, 15.0},
                   .on_road = GoalStretch{.begin_m = 46.0, .offsets_m = std::vector<double>(25)}},
      .slow_stretches = {},
      .cruise_mps = 14.0};

  const Found found = Search(problem, kBeam).run();

  EXPECT_TRUE(found.reaches_goal);
  EXPECT_LT(found.poses[69].x_m, 20.0);
}

// How far it goes in each layer, by the time that a layer takes.
std::vector<double> speeds_of(const Found& found) {
  std::vector<double> speeds;
  double before_m = 0.0;
  for (std::size_t step = 1; step < found.poses.size(); step += 2) {
    speeds.push_back((found.poses[step].x_m - before_m) / (2.0 * kStep_s));
    before_m = found.poses[step].x_m;
  }
  return speeds;
}

TEST(Search, LimitHoldsAgainstAGoalThatNeedsMore) {
  EXPECT_TRUE(found_for({}, goal_at(75.0, 0.0), 10.0).reaches_goal);
  const Found found = found_for({}, goal_at(75.0, 0.0), 10.0, 0.0, 10.0);

  EXPECT_FALSE(found.reaches_goal);
  for (const double speed : speeds_of(found)) {
    EXPECT_LT(speed, 10.0 + 1e-6);
  }
}

TEST(Search, WhoIsAboveTheLimitBrakesComfortably) {
  const std::vector<double> speeds = speeds_of(found_for({}, std::nullopt, 14.0, 0.0, 8.0));

  EXPECT_GT(speeds[2], 11.0);
  for (std::size_t layer = 10; layer < speeds.size(); ++layer) {
    EXPECT_NEAR(speeds[layer], 8.0, 0.5) << layer;
  }
}

TEST(Search, GoesAroundACarThatStands) {
  const Found found = found_for({car(35.0, 0.0, 0.0)}, std::nullopt);

  for (const Pose& pose : found.poses) {
    const bool is_beside = std::abs(pose.x_m - 35.0) < 4.5;
    EXPECT_TRUE(!is_beside || std::abs(pose.y_m) > 1.7) << pose.x_m << " " << pose.y_m;
  }
  EXPECT_GT(found.poses.back().x_m, 60.0);
}

TEST(Search, StopsWhereAllLanesAreBlocked) {
  const Found found = found_for(
      {car(40.0, 0.0, 0.0), car(40.0, kLane_m, 0.0), car(40.0, -kLane_m, 0.0)}, std::nullopt);

  EXPECT_LT(found.poses.back().x_m, 40.0 - 4.5);
}

TEST(Search, GoesOnFromAVehicleThatJustBrakedToAStop) {
  for (const double acceleration_mps2 : {-4.0, -6.0, -8.0, -30.0}) {
    const Found found = found_for({}, std::nullopt, 0.0, acceleration_mps2);

    ASSERT_EQ(found.poses.size(), kSteps) << acceleration_mps2;
    EXPECT_NEAR(found.poses.front().x_m, 0.0, 1e-9) << acceleration_mps2;
  }
}

TEST(Search, GoesOnFromAnAccelerationThatNoVehicleHas) {
  for (const double acceleration_mps2 : {-30.0, 30.0}) {
    EXPECT_EQ(found_for({}, std::nullopt, 10.0, acceleration_mps2).poses.size(), kSteps)
        << acceleration_mps2;
  }
}

TEST(Search, MergesIntoAGapThatMoves) {
  // A gap of 26 m between cars that drive as fast as the vehicle, somewhat behind it.
  const std::vector<TrafficObject> cars = {car(5.0, kLane_m, 10.0), car(-26.0, kLane_m, 10.0),
                                           car(36.0, kLane_m, 10.0)};
  const Found found = found_for(cars, goal_at(55.0, kLane_m));

  EXPECT_TRUE(found.reaches_goal);
  for (std::size_t step = 0; step < 32; ++step) {
    const Pose& pose = found.poses[step];
    const double time = 0.2 * static_cast<double>(step + 1);
    for (const double begin : {5.0, -26.0, 36.0}) {
      const bool is_beside = std::abs(pose.x_m - begin - 10.0 * time) < 4.5;
      EXPECT_TRUE(!is_beside || std::abs(pose.y_m - kLane_m) > 1.7);
    }
  }
}

TEST(Search, FindsTheSameEachTime) {
  const std::vector<TrafficObject> cars = {car(20.0, 0.0, 5.0), car(-10.0, kLane_m, 12.0)};
  const Found one = found_for(cars, goal_at(65.0, kLane_m));
  const Found other = found_for(cars, goal_at(65.0, kLane_m));

  EXPECT_EQ(one.cost, other.cost);
  EXPECT_EQ(one.candidates, other.candidates);
  EXPECT_EQ(one.poses.back().x_m, other.poses.back().x_m);
}

}  // namespace
}  // namespace motion_planning

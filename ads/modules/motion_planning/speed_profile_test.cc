#include "speed_profile.h"

#include <cmath>

#include <gtest/gtest.h>

#include "straight_road.h"

namespace motion_planning {
namespace {

// Straight along x from 0 m to 200 m: 15 m/s, and `ahead_mps` from 100 m on.
Road road_with_limits(double ahead_mps) {
  std::vector<RoadPoint> points;
  for (double x = 0.0; x <= 200.0; x += 1.0) {
    points.push_back({.x_m = x, .speed_limit_mps = x < 99.5 ? 15.0 : ahead_mps});
  }
  return Road(points);
}

SpeedProfile profile(const Road& road, const State& start = {},
                     const std::vector<SlowStretch>& slow = {},
                     const std::optional<Halt>& halt = {}) {
  return {road, slow, halt, start};
}

TEST(SpeedProfile, RoadWithoutLimitsAllowsAnySpeed) {
  const Road road = straight_road();
  const SpeedProfile free = profile(road);

  EXPECT_TRUE(std::isinf(free.at(50.0, 1.0).speed_mps));
  EXPECT_FALSE(free.binding(50.0, 100.0));
}

TEST(SpeedProfile, LowerLimitAheadLeavesTheWayThatComfortableBrakingNeeds) {
  const Road road = road_with_limits(5.0);
  const SpeedProfile slowing = profile(road);

  EXPECT_NEAR(slowing.at(20.0, 0.0).speed_mps, 15.0, 1e-9);
  EXPECT_NEAR(slowing.at(80.0, 0.0).speed_mps, std::sqrt(25.0 + 2.0 * 2.0 * 19.0), 0.1);
  // The limit is kept from 1 m before its begin on.
  EXPECT_NEAR(slowing.at(99.5, 0.0).speed_mps, 5.0, 1e-9);
  EXPECT_NEAR(slowing.at(100.0, 0.0).speed_mps, 5.0, 0.01);
  EXPECT_NEAR(slowing.at(180.0, 0.0).speed_mps, 5.0, 1e-9);
}

TEST(SpeedProfile, HigherLimitHoldsFromItsBeginOn) {
  const Road road = road_with_limits(25.0);
  const SpeedProfile rising = profile(road);

  EXPECT_EQ(rising.at(98.9, 0.0).speed_mps, 15.0);
  EXPECT_EQ(rising.at(100.1, 0.0).speed_mps, 25.0);
}

TEST(SpeedProfile, RoadIsLimitedOnlyWhereTheMapSaysSo) {
  const Road road = road_with_limits(0.0);
  const SpeedProfile ending = profile(road);

  EXPECT_EQ(ending.at(50.0, 0.0).speed_mps, 15.0);
  EXPECT_TRUE(std::isinf(ending.at(150.0, 0.0).speed_mps));
}

TEST(SpeedProfile, WhoBeginsTooFastBrakesComfortably) {
  const Road road = road_with_limits(15.0);
  const SpeedProfile profile_above = profile(road, {.speed_mps = 21.0});

  // Braking builds up within 2/3 s, in which two thirds of a metre per second are lost.
  EXPECT_EQ(profile_above.at(0.0, 0.0).speed_mps, 21.0);
  EXPECT_NEAR(profile_above.at(0.0, 2.0 / 3.0).speed_mps, 21.0 - 2.0 / 3.0, 1e-9);
  EXPECT_NEAR(profile_above.at(0.0, 2.0).speed_mps, 21.0 - 2.0 / 3.0 - 2.0 * 4.0 / 3.0, 1e-9);
  EXPECT_EQ(profile_above.at(0.0, 4.0).speed_mps, 15.0);
}

TEST(SpeedProfile, ThatTheVehicleSpeedsUpIsNoExcuse) {
  const Road road = road_with_limits(15.0);

  EXPECT_EQ(profile(road, {.speed_mps = 14.9, .acceleration_mps2 = 2.0}).at(0.0, 0.5).speed_mps,
            15.0);
  EXPECT_LT(profile(road, {.speed_mps = 15.1, .acceleration_mps2 = 2.0}).at(0.0, 0.5).speed_mps,
            15.1);
}

TEST(SpeedProfile, SlowStretchIsReachedSlowly) {
  const Road road = straight_road();
  const SpeedProfile slowing =
      profile(road, {}, {{.begin_m = 60.0, .end_m = 80.0, .speed_mps = 4.0}});

  EXPECT_NEAR(slowing.at(60.0, 0.0).speed_mps, 4.0, 1e-9);
  EXPECT_NEAR(slowing.at(79.0, 0.0).speed_mps, 4.0, 1e-9);
  EXPECT_TRUE(std::isinf(slowing.at(81.0, 0.0).speed_mps));
  EXPECT_NEAR(slowing.at(40.0, 0.0).speed_mps, std::sqrt(16.0 + 2.0 * 2.0 * 20.0), 0.3);
}

TEST(SpeedProfile, NothingIsAllowedBehindAStop) {
  const Road road = straight_road();
  const SpeedProfile stopping =
      profile(road, {.speed_mps = 9.0}, {}, Halt{.along_m = 50.0, .braking_mps2 = 2.0});

  EXPECT_NEAR(stopping.at(25.0, 0.0).speed_mps, 10.0, 1e-9);
  EXPECT_EQ(stopping.at(50.0, 0.0).speed_mps, 0.0);
  EXPECT_EQ(stopping.at(60.0, 0.0).speed_mps, 0.0);
}

TEST(SpeedProfile, RuleBindsWhoIsWithinTheTolerance) {
  const Road road = road_with_limits(5.0);
  const SpeedProfile slowing = profile(road);

  EXPECT_FALSE(slowing.binding(20.0, 14.6));
  const std::optional<Rule> here = slowing.binding(20.0, 14.8);
  ASSERT_TRUE(here);
  EXPECT_EQ(here->speed_mps, 15.0);
  EXPECT_EQ(here->along_m, 0.0);
  // On the way to the lower limit that one binds.
  const std::optional<Rule> ahead = slowing.binding(90.0, 8.0);
  ASSERT_TRUE(ahead);
  EXPECT_EQ(ahead->kind, RuleKind::kSpeedLimit);
  EXPECT_EQ(ahead->speed_mps, 5.0);
  EXPECT_NEAR(ahead->along_m, 100.0, 1.5);
}

TEST(SpeedProfile, StopTellsForWhomItIs) {
  const Road road = road_with_limits(15.0);
  const SpeedProfile stopping =
      profile(road, {}, {}, Halt{.along_m = 50.0, .kind = RuleKind::kGiveWay, .object = 7});

  const std::optional<Rule> rule = stopping.binding(49.9, 0.4);
  ASSERT_TRUE(rule);
  EXPECT_EQ(rule->kind, RuleKind::kGiveWay);
  EXPECT_EQ(rule->object, 7U);
  EXPECT_EQ(rule->speed_mps, 0.0);
}

}  // namespace
}  // namespace motion_planning

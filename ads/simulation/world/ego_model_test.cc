#include "ego_model.h"

#include <cmath>

#include <gtest/gtest.h>

namespace ads {
namespace {

EgoModel model(double speed_mps, double steering_rad = 0.0) {
  return {EgoLimits(), {.speed_mps = speed_mps, .steering_rad = steering_rad}};
}

void advance(EgoModel& model, double seconds, const EgoDemand& demand) {
  for (double time = 0.0; time < seconds - 1e-9; time += 0.01) {
    model.advance(0.01, demand);
  }
}

TEST(EgoModel, StraightWheelsLeadStraightOn) {
  EgoModel ego = model(10.0);

  advance(ego, 2.0, {.acceleration_mps2 = 1.0});

  EXPECT_NEAR(ego.state().center_m.x(), 22.0, 1e-9);
  EXPECT_EQ(ego.state().center_m.y(), 0.0);
  EXPECT_NEAR(ego.state().speed_mps, 12.0, 1e-9);
  EXPECT_NEAR(ego.state().acceleration_mps2, 1.0, 1e-9);
}

TEST(EgoModel, TurnedWheelsLeadAroundACircle) {
  EgoModel ego = model(5.0, 0.3);
  const double radius_m = 2.58 / std::tan(0.3);
  // The rear axle goes around a centre to its left.
  const Eigen::Vector2d middle(-1.29, radius_m);

  for (int tick = 0; tick < 500; ++tick) {
    ego.advance(0.01, {.steering_rad = 0.3});
    const Eigen::Vector2d rear = ego.state().center_m - 1.29 * direction(ego.state().heading_rad);
    ASSERT_NEAR((rear - middle).norm(), radius_m, 1e-9);
    ASSERT_NEAR(ego.state().yaw_rate_radps, 5.0 / radius_m, 1e-12);
  }
}

TEST(EgoModel, WheelsTurnNoFasterAndNoFartherThanTheyCan) {
  EgoModel ego = model(0.0);

  ego.advance(0.01, {.steering_rad = 2.0});
  EXPECT_NEAR(ego.state().steering_rad, 0.004, 1e-12);

  advance(ego, 4.0, {.steering_rad = 2.0});
  EXPECT_EQ(ego.state().steering_rad, 1.066);
  EXPECT_TRUE(ego.state().center_m.isZero(1e-12));
}

TEST(EgoModel, ForcesHaveTheirLimits) {
  EgoModel ego = model(20.0);

  ego.advance(0.01, {.acceleration_mps2 = 100.0});
  EXPECT_NEAR(ego.state().acceleration_mps2, 4.0, 1e-9);
  ego.advance(0.01, {.acceleration_mps2 = -100.0});
  EXPECT_NEAR(ego.state().acceleration_mps2, -8.0, 1e-9);
}

TEST(EgoModel, BrakesStopItButDoNotTurnItAround) {
  EgoModel ego = model(10.0);

  advance(ego, 5.0, {.acceleration_mps2 = -4.0});

  EXPECT_EQ(ego.state().speed_mps, 0.0);
  EXPECT_EQ(ego.state().acceleration_mps2, 0.0);
  EXPECT_NEAR(ego.state().center_m.x(), 12.5, 1e-9);
}

TEST(EgoModel, StopWithinAStepIsExact) {
  EgoModel ego = model(0.03);

  ego.advance(0.01, {.acceleration_mps2 = -6.0});

  EXPECT_EQ(ego.state().speed_mps, 0.0);
  EXPECT_NEAR(ego.state().center_m.x(), 0.03 * 0.03 / 12.0, 1e-12);
  EXPECT_NEAR(ego.state().acceleration_mps2, -3.0, 1e-9);
}

TEST(EgoModel, ThatUndersteersTurnsLessTheFasterItIs) {
  for (const double speed_mps : {1.0, 10.0, 20.0}) {
    const EgoDeviation deviation{.understeer_s2_per_m2 = 0.002};
    EgoModel ego(EgoLimits(), {.speed_mps = speed_mps, .steering_rad = 0.1}, deviation);

    ego.advance(0.01, {.steering_rad = 0.1});

    EXPECT_NEAR(ego.state().yaw_rate_radps,
                speed_mps * std::tan(0.1) / (2.58 * (1.0 + 0.002 * speed_mps * speed_mps)), 1e-9);
    EXPECT_NEAR(ego.state().heading_rad, 0.01 * ego.state().yaw_rate_radps, 1e-9);
  }
}

TEST(EgoModel, ThatIsHeavyAndGoesUphillIsSlowerThanDemanded) {
  EgoModel ego(EgoLimits(), {.speed_mps = 10.0}, {.force_gain = 0.8, .resistance_mps2 = 0.3});

  advance(ego, 2.0, {.acceleration_mps2 = 1.0});

  EXPECT_NEAR(ego.state().acceleration_mps2, 0.5, 1e-9);
  EXPECT_NEAR(ego.state().speed_mps, 11.0, 1e-9);
}

TEST(EgoModel, ThatStandsUphillDoesNotRollBackwards) {
  EgoModel ego(EgoLimits(), EgoState(), {.resistance_mps2 = 0.3});

  advance(ego, 1.0, {});

  EXPECT_EQ(ego.state().speed_mps, 0.0);
  EXPECT_EQ(ego.state().center_m.x(), 0.0);
}

TEST(EgoModel, WithALagFollowsADemandWithItsTimeConstant) {
  EgoModel ego(EgoLimits(), {.speed_mps = 10.0},
               {.acceleration_lag_s = 0.2, .steering_lag_s = 0.1});

  advance(ego, 0.2, {.steering_rad = 0.01, .acceleration_mps2 = 1.0});

  EXPECT_NEAR(ego.state().acceleration_mps2, 1.0 - std::exp(-1.0), 0.02);
  EXPECT_NEAR(ego.state().steering_rad, 0.01 * (1.0 - std::exp(-2.0)), 0.0005);
}

TEST(EgoModel, BoxIsAroundItsCentre) {
  const EgoModel ego(EgoLimits(), {.center_m = {3.0, 4.0}, .heading_rad = 0.5});

  EXPECT_EQ(ego.box().center_m, Eigen::Vector2d(3.0, 4.0));
  EXPECT_EQ(ego.box().heading_rad, 0.5);
  EXPECT_EQ(ego.box().length_m, 4.508);
  EXPECT_EQ(ego.box().width_m, 1.610);
}

}  // namespace
}  // namespace ads

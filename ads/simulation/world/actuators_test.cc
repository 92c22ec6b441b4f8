#include "actuators.h"

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr Actuators::Options kOptions{
    .delay_s = 0.1, .timeout_s = 0.5, .timeout_braking_mps2 = 4.0};
const EgoState kTurning{.speed_mps = 10.0, .steering_rad = 0.2};

Actuators::Command command(double acceleration_mps2, bool is_autonomous = true) {
  return {.demand = {.steering_rad = 0.1, .acceleration_mps2 = acceleration_mps2},
          .is_autonomous = is_autonomous};
}

TEST(Actuators, WithoutCommandsADriverHoldsTheSpeed) {
  Actuators actuators(kOptions);

  const EgoDemand demand = actuators.demand_at(3.0, kTurning);

  EXPECT_EQ(demand.steering_rad, 0.0);
  EXPECT_EQ(demand.acceleration_mps2, 0.0);
  EXPECT_FALSE(actuators.is_autonomous());
}

TEST(Actuators, CommandTakesEffectAfterItsDelay) {
  Actuators actuators(kOptions);
  actuators.take(1.0, command(2.0));
  actuators.take(1.02, command(-1.0));

  EXPECT_EQ(actuators.demand_at(1.09, kTurning).acceleration_mps2, 0.0);
  EXPECT_EQ(actuators.demand_at(1.10, kTurning).acceleration_mps2, 2.0);
  EXPECT_EQ(actuators.demand_at(1.11, kTurning).acceleration_mps2, 2.0);
  EXPECT_EQ(actuators.demand_at(1.12, kTurning).acceleration_mps2, -1.0);
  EXPECT_EQ(actuators.demand_at(1.13, kTurning).steering_rad, 0.1);
  EXPECT_TRUE(actuators.is_autonomous());
}

TEST(Actuators, CommandThatIsNotAutonomousGivesTheVehicleBack) {
  Actuators actuators(kOptions);
  actuators.take(1.0, command(2.0));
  actuators.take(1.02, command(2.0, false));

  EXPECT_EQ(actuators.demand_at(1.10, kTurning).acceleration_mps2, 2.0);
  EXPECT_EQ(actuators.demand_at(1.12, kTurning).acceleration_mps2, 0.0);
  EXPECT_FALSE(actuators.is_autonomous());
  EXPECT_EQ(actuators.demand_at(9.0, kTurning).acceleration_mps2, 0.0);
  EXPECT_FALSE(actuators.is_timed_out());
}

TEST(Actuators, VehicleBrakesByItselfWhenCommandsCease) {
  Actuators actuators(kOptions);
  actuators.take(1.0, command(2.0));

  EXPECT_EQ(actuators.demand_at(1.6, kTurning).acceleration_mps2, 2.0);
  const EgoDemand demand = actuators.demand_at(1.61, kTurning);
  EXPECT_EQ(demand.acceleration_mps2, -4.0);
  EXPECT_EQ(demand.steering_rad, 0.2);
  EXPECT_TRUE(actuators.is_timed_out());

  actuators.take(2.0, command(1.0));
  EXPECT_EQ(actuators.demand_at(2.1, kTurning).acceleration_mps2, 1.0);
  EXPECT_FALSE(actuators.is_timed_out());
}

TEST(Actuators, FloodOfCommandsIsBounded) {
  Actuators actuators(kOptions);
  for (int count = 0; count < 100'000; ++count) {
    actuators.take(1.0, command(count));
  }

  EXPECT_EQ(actuators.demand_at(1.1, kTurning).acceleration_mps2, 99'999.0);
}

}  // namespace
}  // namespace ads

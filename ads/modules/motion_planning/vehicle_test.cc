#include "vehicle.h"

#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace motion_planning {
namespace {

StateVector vector_of(const State& state) {
  StateVector vector;
  vector << state.x_m, state.y_m, state.heading_rad, state.speed_mps, state.acceleration_mps2,
      state.steering_rad;
  return vector;
}

State state_of(const StateVector& vector) {
  return {.x_m = vector(0),
          .y_m = vector(1),
          .heading_rad = vector(2),
          .speed_mps = vector(3),
          .acceleration_mps2 = vector(4),
          .steering_rad = vector(5)};
}

TEST(Vehicle, DrivesStraightWithConstantAcceleration) {
  const State to = drive(Vehicle{}, {.speed_mps = 10.0, .acceleration_mps2 = 2.0}, {}, 0.5);

  EXPECT_NEAR(to.x_m, 5.25, 1e-12);
  EXPECT_NEAR(to.speed_mps, 11.0, 1e-12);
  EXPECT_EQ(to.y_m, 0.0);
}

TEST(Vehicle, RearAxleRunsAroundACircle) {
  const Vehicle vehicle;
  State state{.speed_mps = 2.0, .steering_rad = 0.4};
  const double radius = vehicle.wheelbase_m / std::tan(0.4);
  const double around_s = 2.0 * std::numbers::pi * radius / 2.0;
  const int steps = 1000;
  for (int step = 0; step < steps; ++step) {
    state = drive(vehicle, state, {}, around_s / steps);
  }

  EXPECT_NEAR(state.x_m, 0.0, 1e-3);
  EXPECT_NEAR(state.y_m, 0.0, 1e-3);
  EXPECT_NEAR(state.heading_rad, 2.0 * std::numbers::pi, 1e-9);
  EXPECT_NEAR(yaw_rate(vehicle, state), 2.0 / radius, 1e-12);
}

TEST(Vehicle, DerivativesAreThoseOfTheStep) {
  const Vehicle vehicle;
  const State from{.x_m = 3.0,
                   .y_m = -2.0,
                   .heading_rad = 0.7,
                   .speed_mps = 6.0,
                   .acceleration_mps2 = -1.0,
                   .steering_rad = 0.2};
  const Input input{.jerk_mps3 = 2.0, .steering_rate_radps = -0.1};
  StepJacobians jacobians;
  drive(vehicle, from, input, 0.2, &jacobians);

  const double delta = 1e-6;
  for (int column = 0; column < 6; ++column) {
    StateVector more = vector_of(from);
    StateVector less = vector_of(from);
    more(column) += delta;
    less(column) -= delta;
    const StateVector slope = (vector_of(drive(vehicle, state_of(more), input, 0.2)) -
                               vector_of(drive(vehicle, state_of(less), input, 0.2))) /
                              (2.0 * delta);
    EXPECT_LT((slope - jacobians.by_state.col(column)).norm(), 1e-6) << column;
  }
  const std::array<Input, 2> directions = {Input{delta, 0.0}, Input{0.0, delta}};
  for (int column = 0; column < 2; ++column) {
    const Input& change = directions[static_cast<std::size_t>(column)];
    const Input more{input.jerk_mps3 + change.jerk_mps3,
                     input.steering_rate_radps + change.steering_rate_radps};
    const Input less{input.jerk_mps3 - change.jerk_mps3,
                     input.steering_rate_radps - change.steering_rate_radps};
    const StateVector slope =
        (vector_of(drive(vehicle, from, more, 0.2)) - vector_of(drive(vehicle, from, less, 0.2))) /
        (2.0 * delta);
    EXPECT_LT((slope - jacobians.by_input.col(column)).norm(), 1e-6) << column;
  }
}

}  // namespace
}  // namespace motion_planning

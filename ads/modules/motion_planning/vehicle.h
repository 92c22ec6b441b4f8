#pragma once

#include <Eigen/Core>

namespace motion_planning {

/// The vehicle's box, axles, and limits. All states refer to the centre of its box.
struct Vehicle {
  double length_m = 4.508;
  double width_m = 1.610;
  double wheelbase_m = 2.58;
  double centre_to_rear_axle_m = 1.29;
  double steering_max_rad = 1.066;
  double steering_rate_max_radps = 0.4;
};

/// A state of the kinematic single-track model: the box's centre, the body's heading, the speed
/// along it, acceleration, and the angle of the front wheels (left positive).
struct State {
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;
  double speed_mps = 0.0;
  double acceleration_mps2 = 0.0;
  double steering_rad = 0.0;

  friend bool operator==(const State&, const State&) = default;
};

/// The input of a step; both values are constant over a step.
struct Input {
  double jerk_mps3 = 0.0;
  double steering_rate_radps = 0.0;

  friend bool operator==(const Input&, const Input&) = default;
};

using StateVector = Eigen::Matrix<double, 6, 1>;
using StateMatrix = Eigen::Matrix<double, 6, 6>;
using InputVector = Eigen::Matrix<double, 2, 1>;
using InputMatrix = Eigen::Matrix<double, 6, 2>;

/// The derivatives of a step's end by its begin and by the input, in the order of the members.
struct StepJacobians {
  StateMatrix by_state;
  InputMatrix by_input;
};

/// The state `step_s` later: kinematic single-track model, rolling without slip (Rajamani, "Vehicle
/// Dynamics and Control", 2nd edition, 2012, section 2.2), speed, steering and heading in the
/// middle of the step. `jacobians`, if given, gets the derivatives.
State drive(const Vehicle& vehicle, const State& from, const Input& input, double step_s,
            StepJacobians* jacobians = nullptr);

/// The state interpolated by `share`; the headings must be continuous.
State between(const State& from, const State& to, double share);

/// The yaw rate.
double yaw_rate(const Vehicle& vehicle, const State& state);

}  // namespace motion_planning

#include "vehicle.h"

#include <cmath>

namespace motion_planning {

State drive(const Vehicle& vehicle, const State& from, const Input& input, double step_s,
            StepJacobians* jacobians) {
  const double half = step_s / 2.0;
  const double speed = from.speed_mps + half * from.acceleration_mps2;
  const double steering = from.steering_rad + half * input.steering_rate_radps;
  const double tangent = std::tan(steering) / vehicle.wheelbase_m;
  const double turn = speed * tangent;  // The yaw rate.
  const double heading = from.heading_rad + half * turn;
  const double cosine = std::cos(heading);
  const double sine = std::sin(heading);
  const double lever = vehicle.centre_to_rear_axle_m;
  const double side = lever * turn;  // The centre's speed to the left.

  State to = from;
  to.x_m += step_s * (speed * cosine - side * sine);
  to.y_m += step_s * (speed * sine + side * cosine);
  to.heading_rad += step_s * turn;
  to.speed_mps += step_s * from.acceleration_mps2 + step_s * half * input.jerk_mps3;
  to.acceleration_mps2 += step_s * input.jerk_mps3;
  to.steering_rad += step_s * input.steering_rate_radps;
  if (jacobians == nullptr) {
    return to;
  }

  const double turn_by_steering =
      speed / (vehicle.wheelbase_m * std::cos(steering) * std::cos(steering));
  // By heading in the middle, by speed and by steering there.
  const double x_by_heading = step_s * (-speed * sine - side * cosine);
  const double y_by_heading = step_s * (speed * cosine - side * sine);
  const double x_by_turn = x_by_heading * half - step_s * lever * sine;
  const double y_by_turn = y_by_heading * half + step_s * lever * cosine;
  const double x_by_speed = step_s * cosine + x_by_turn * tangent;
  const double y_by_speed = step_s * sine + y_by_turn * tangent;

  StateMatrix& a = jacobians->by_state;
  a.setIdentity();
  a(0, 2) = x_by_heading;
  a(1, 2) = y_by_heading;
  a(0, 3) = x_by_speed;
  a(1, 3) = y_by_speed;
  a(2, 3) = step_s * tangent;
  a(0, 4) = half * x_by_speed;
  a(1, 4) = half * y_by_speed;
  a(2, 4) = half * step_s * tangent;
  a(3, 4) = step_s;
  a(0, 5) = x_by_turn * turn_by_steering;
  a(1, 5) = y_by_turn * turn_by_steering;
  a(2, 5) = step_s * turn_by_steering;
  InputMatrix& b = jacobians->by_input;
  b.setZero();
  b.block<3, 1>(0, 1) = half * a.block<3, 1>(0, 5);
  b(3, 0) = step_s * half;
  b(4, 0) = step_s;
  b(5, 1) = step_s;
  return to;
}

State between(const State& from, const State& to, double share) {
  return {.x_m = std::lerp(from.x_m, to.x_m, share),
          .y_m = std::lerp(from.y_m, to.y_m, share),
          .heading_rad = std::lerp(from.heading_rad, to.heading_rad, share),
          .speed_mps = std::lerp(from.speed_mps, to.speed_mps, share),
          .acceleration_mps2 = std::lerp(from.acceleration_mps2, to.acceleration_mps2, share),
          .steering_rad = std::lerp(from.steering_rad, to.steering_rad, share)};
}

double yaw_rate(const Vehicle& vehicle, const State& state) {
  return state.speed_mps * std::tan(state.steering_rad) / vehicle.wheelbase_m;
}

}  // namespace motion_planning

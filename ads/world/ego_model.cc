#include "ego_model.h"

#include <algorithm>
#include <cmath>

namespace ads {
namespace {

// sin(x) / x
double sinc(double x) {
  return std::abs(x) < 1e-6 ? 1.0 - x * x / 6.0 : std::sin(x) / x;
}

}  // namespace

void EgoModel::advance(double seconds, const EgoDemand& demand) {
  const double turn_max = limits_.steering_rate_max_radps * seconds;
  const double wheels =
      std::clamp(demand.steering_rad, -limits_.steering_max_rad, limits_.steering_max_rad);
  const double steering =
      state_.steering_rad + std::clamp(wheels - state_.steering_rad, -turn_max, turn_max);
  const double acceleration = std::clamp(demand.acceleration_mps2, -limits_.deceleration_max_mps2,
                                         limits_.acceleration_max_mps2);

  const double before_mps = state_.speed_mps;
  const double after_mps = std::max(0.0, before_mps + acceleration * seconds);
  // A vehicle that stops within the step brakes for a part of it only.
  const double braking_s =
      before_mps + acceleration * seconds < 0.0 ? before_mps / -acceleration : seconds;
  const double distance_m = (before_mps + after_mps) / 2.0 * braking_s;
  const double curvature = std::tan((state_.steering_rad + steering) / 2.0) / limits_.wheelbase_m;
  const double turn_rad = curvature * distance_m;

  // The rear axle moves along an arc: its chord.
  const double to_rear_m = limits_.wheelbase_m / 2.0;
  const Eigen::Vector2d rear =
      state_.center_m - to_rear_m * direction(state_.heading_rad) +
      distance_m * sinc(turn_rad / 2.0) * direction(state_.heading_rad + turn_rad / 2.0);
  state_.heading_rad = normalize_angle(state_.heading_rad + turn_rad);
  state_.center_m = rear + to_rear_m * direction(state_.heading_rad);
  state_.acceleration_mps2 = (after_mps - before_mps) / seconds;
  state_.speed_mps = after_mps;
  state_.steering_rad = steering;
  state_.yaw_rate_radps = after_mps * std::tan(steering) / limits_.wheelbase_m;
}

}  // namespace ads

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

double EgoModel::wheelbase_at_m(double speed_mps) const {
  return limits_.wheelbase_m * (1.0 + deviation_.understeer_s2_per_m2 * speed_mps * speed_mps);
}

void EgoModel::advance(double seconds, const EgoDemand& demand) {
  const auto share_of = [seconds](double lag_s) { return seconds / (seconds + lag_s); };
  const double turn_max = limits_.steering_rate_max_radps * seconds;
  const double wheels =
      std::clamp(demand.steering_rad, -limits_.steering_max_rad, limits_.steering_max_rad);
  const double turn = share_of(deviation_.steering_lag_s) * (wheels - state_.steering_rad);
  const double steering = state_.steering_rad + std::clamp(turn, -turn_max, turn_max);
  const double force = std::clamp(demand.acceleration_mps2, -limits_.deceleration_max_mps2,
                                  limits_.acceleration_max_mps2);
  force_mps2_ = std::lerp(force_mps2_, force, share_of(deviation_.acceleration_lag_s));
  const double acceleration = deviation_.force_gain * force_mps2_ - deviation_.resistance_mps2;

  const double before_mps = state_.speed_mps;
  const double after_mps = std::max(0.0, before_mps + acceleration * seconds);
  // A vehicle that stops within the step brakes for a part of it only.
  const double braking_s =
      before_mps + acceleration * seconds < 0.0 ? before_mps / -acceleration : seconds;
  const double distance_m = (before_mps + after_mps) / 2.0 * braking_s;
  const double gain = deviation_.steering_gain;
  const double curvature =
      std::tan(gain * (state_.steering_rad + steering) / 2.0) / wheelbase_at_m(before_mps);
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
  state_.yaw_rate_radps = after_mps * std::tan(gain * steering) / wheelbase_at_m(after_mps);
}

}  // namespace ads

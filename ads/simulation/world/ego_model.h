#pragma once

#include <Eigen/Core>

#include "common/plane.h"

namespace ads {

/// Dimensions and limits of the ego vehicle.
struct EgoLimits {
  double length_m = 4.508;
  double width_m = 1.610;
  double height_m = 1.42;
  double wheelbase_m = 2.58;
  double steering_max_rad = 1.066;
  double steering_rate_max_radps = 0.4;
  double acceleration_max_mps2 = 4.0;
  double deceleration_max_mps2 = 8.0;
};

/// Deviations of a vehicle from the controller's model. None by default.
struct EgoDeviation {
  /// The ratio of the effective angle of the front wheels to the commanded one.
  double steering_gain = 1.0;
  /// Understeer: curvature is divided by 1 + this * speed^2 (Rajamani, section 3.3).
  double understeer_s2_per_m2 = 0.0;
  /// The ratio of the acceleration reached to the demanded one: a heavier vehicle.
  double force_gain = 1.0;
  /// The deceleration without any demand: a slope, wind.
  double resistance_mps2 = 0.0;
  /// Time constants of the response to a demand.
  double acceleration_lag_s = 0.0;
  double steering_lag_s = 0.0;
  /// The ratio of the measured speed to the true one.
  double speed_gain = 1.0;
};

struct EgoState {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();  ///< Of its box: midway between its axles.
  double heading_rad = 0.0;
  double speed_mps = 0.0;          ///< Along the heading.
  double acceleration_mps2 = 0.0;  ///< Along the heading.
  double steering_rad = 0.0;       ///< Of the front wheels, left positive.
  double yaw_rate_radps = 0.0;
};

/// The input of the ego vehicle: the wheels turn towards `steering_rad` at their maximum rate.
struct EgoDemand {
  double steering_rad = 0.0;
  double acceleration_mps2 = 0.0;
};

/// The motion of the ego vehicle: a kinematic single-track model without slip, except for its
/// deviations. It does not drive backwards.
///
/// R. Rajamani, "Vehicle Dynamics and Control", 2nd edition, Springer 2012, section 2.2.
///
/// @threads  Compatible.
class EgoModel {
 public:
  EgoModel(const EgoLimits& limits, const EgoState& initial, const EgoDeviation& deviation = {})
      : limits_(limits), deviation_(deviation), state_(initial) {}

  /// Advances by `seconds`, above 0, along an arc. Demands are clamped to the limits.
  void advance(double seconds, const EgoDemand& demand);

  [[nodiscard]] const EgoState& state() const { return state_; }
  [[nodiscard]] Box box() const {
    return {.center_m = state_.center_m,
            .heading_rad = state_.heading_rad,
            .length_m = limits_.length_m,
            .width_m = limits_.width_m};
  }

 private:
  /// The wheelbase of a vehicle without deviations that turns as this one does.
  [[nodiscard]] double wheelbase_at_m(double speed_mps) const;

  EgoLimits limits_;
  EgoDeviation deviation_;
  EgoState state_;
  double force_mps2_ = 0.0;  // The acceleration by drive and brakes without resistance.
};

}  // namespace ads

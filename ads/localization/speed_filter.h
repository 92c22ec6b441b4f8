#pragma once

#include <chrono>
#include <optional>

#include <Eigen/Core>

namespace ads {

/// Standard deviations are 1 sigma.
struct SpeedFilterConfig {
  double wheel_noise_mps = 0.02;
  double acceleration_noise_mps2 = 0.67;
  double acceleration_bias_mps2 = 0.1;
  /// How fast the acceleration changes.
  double jerk_mps3_per_sqrt_hz = 2.0;
};

/// Estimates speed and acceleration along the heading from wheel speeds and an accelerometer: a
/// linear Kalman filter of speed [m/s], acceleration, which walks at random, and the
/// accelerometer's offset [m/s^2].
///
/// Times of successive calls must not decrease; an earlier one counts as the last.
///
/// @threads  Confined.
class SpeedFilter {
 public:
  explicit SpeedFilter(const SpeedFilterConfig& config);

  void on_wheel_speed(std::chrono::nanoseconds time, double mps);
  void on_acceleration(std::chrono::nanoseconds time, double mps2);

  [[nodiscard]] double speed_mps() const { return state_[0]; }
  [[nodiscard]] double acceleration_mps2() const { return state_[1]; }
  [[nodiscard]] double speed_variance() const { return covariance_(0, 0); }

 private:
  void advance_to(std::chrono::nanoseconds time);
  void update(const Eigen::Vector3d& jacobian, double measured, double noise);

  const SpeedFilterConfig config_;
  std::optional<std::chrono::nanoseconds> time_;
  Eigen::Vector3d state_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance_;
};

}  // namespace ads

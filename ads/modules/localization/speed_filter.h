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
  /// The random walk of the acceleration.
  double jerk_mps3_per_sqrt_hz = 2.0;
};

/// Estimates speed and acceleration along the heading from wheel speeds and an accelerometer: a
/// linear Kalman filter of speed [m/s], acceleration, as a random walk, and the accelerometer's
/// offset [m/s^2].
///
/// Times of successive calls must not decrease; an earlier one counts as the last.
///
/// @threads  Confined.
class SpeedFilter {
 public:
  /// The complete state of the filter.
  struct Memory {
    std::optional<std::chrono::nanoseconds> time;
    Eigen::Vector3d state = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  };

  explicit SpeedFilter(const SpeedFilterConfig& config);

  [[nodiscard]] const Memory& memory() const { return memory_; }
  /// Restores the state of another filter with the same configuration.
  void set_memory(const Memory& memory) { memory_ = memory; }

  void on_wheel_speed(std::chrono::nanoseconds time, double mps);
  void on_acceleration(std::chrono::nanoseconds time, double mps2);

  [[nodiscard]] double speed_mps() const { return memory_.state[0]; }
  [[nodiscard]] double acceleration_mps2() const { return memory_.state[1]; }
  [[nodiscard]] double speed_variance() const { return memory_.covariance(0, 0); }

 private:
  void advance_to(std::chrono::nanoseconds time);
  void update(const Eigen::Vector3d& jacobian, double measured, double noise);

  const SpeedFilterConfig config_;
  Memory memory_;
};

}  // namespace ads

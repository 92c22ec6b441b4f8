#pragma once

#include <chrono>
#include <optional>

#include <Eigen/Core>

namespace rav4 {

/// Estimates the vertical for a device mounted at an angle, and the turn rate about it.
///
/// Averaged over some seconds, an accelerometer in a car measures the reaction to gravity: it
/// points up (Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation
/// Systems", 2nd edition, 2013, section 5.6.2, levelling). The average is a first-order low pass.
///
/// Axes are those of the device: x forward, y to the right, z down.
///
/// @threads  Confined.
class Level {
 public:
  explicit Level(double time_constant_s) : time_constant_s_(time_constant_s) {}

  /// Takes a measured acceleration [m/s^2]; a non-finite one is ignored.
  void on_acceleration(std::chrono::nanoseconds time, const Eigen::Vector3d& acceleration);

  /// The turn rate about the vertical [rad/s], counter-clockwise seen from above. Before the first
  /// acceleration the device is assumed level.
  [[nodiscard]] double yaw_rate(const Eigen::Vector3d& turn_rate) const;

 private:
  const double time_constant_s_;

  std::optional<std::chrono::nanoseconds> time_;
  Eigen::Vector3d up_{0.0, 0.0, -1.0};  // Not of length 1.
};

}  // namespace rav4

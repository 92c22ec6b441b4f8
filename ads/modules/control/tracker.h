#pragma once

#include <cstddef>
#include <deque>
#include <utility>
#include <vector>

namespace ads {

/// The reference at one time: the centre of the vehicle's box, the body's heading, and the speed
/// along it. The curvature is that of the rear axle's path: yaw rate over speed, positive to the
/// left.
struct Reference {
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;
  double curvature_per_m = 0.0;
  double speed_mps = 0.0;
  double acceleration_mps2 = 0.0;

  friend bool operator==(const Reference&, const Reference&) = default;
};

/// References at equal time intervals.
struct Path {
  double start_s = 0.0;
  double step_s = 0.1;
  std::vector<Reference> points = {};

  /// Interpolated between the points; at rest at the last one after it. @pre  There are points.
  [[nodiscard]] Reference at(double time_s) const;
  /// The nearest point to a position on the line through the points.
  [[nodiscard]] Reference nearest(double x_m, double y_m) const;

  friend bool operator==(const Path&, const Path&) = default;
};

/// Where the vehicle is: the centre of its box.
struct Motion {
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;
  double speed_mps = 0.0;
  double acceleration_mps2 = 0.0;
  double steering_rad = 0.0;
};

struct Actuation {
  double steering_rad = 0.0;
  double acceleration_mps2 = 0.0;

  friend bool operator==(const Actuation&, const Actuation&) = default;
};

/// The deviation of the vehicle from its reference. Positive: to the left, turned to the left, too
/// fast, too far ahead.
struct TrackingError {
  double lateral_m = 0.0;
  double heading_rad = 0.0;
  double speed_mps = 0.0;
  double along_m = 0.0;
};

struct TrackerConfig {
  double wheelbase_m = 2.58;
  double centre_to_rear_axle_m = 1.29;
  double steering_max_rad = 1.066;
  double steering_rate_max_radps = 0.4;
  double acceleration_min_mps2 = -8.0;
  double acceleration_max_mps2 = 4.0;
  double jerk_max_mps3 = 40.0;
  /// The delay of commands: dead time, and the time constant of the first-order lag after it.
  double steering_delay_s = 0.1;
  double acceleration_delay_s = 0.1;
  double acceleration_lag_s = 0.0;
  /// Lateral errors decay within this length: the larger of a length and a time at the present
  /// speed.
  double lateral_length_m = 4.0;
  double lateral_time_s = 0.7;
  double lateral_damping = 0.9;
  double position_gain_per_s2 = 0.8;
  double speed_gain_per_s = 1.6;
  /// Gain of the integral action, relative to the gain that makes the loop unstable; 0: none.
  double lateral_integral = 0.0;
  double along_integral = 0.0;
  /// The limits of its output: of the curvature, of the acceleration.
  double lateral_integral_max_per_m = 0.02;
  double along_integral_max_mps2 = 1.0;
};

/// Follows a path in time; README.md describes the control law.
///
/// @threads  Confined.
class Tracker {
 public:
  struct Past {
    double time_s = 0.0;
    Actuation command = {};
  };
  /// The controller's state: all that determines the next command besides its inputs.
  struct Memory {
    std::deque<Past> past = {};  ///< Commands of the last second, oldest first.
    TrackingError error = {};
    double curvature_per_m = 0.0;    ///< Integral term, added to the reference's.
    double acceleration_mps2 = 0.0;  ///< The same.
  };

  explicit Tracker(const TrackerConfig& config) : config_(config) {}

  /// The command for `now_s` with which the vehicle, which was at `motion` at `motion_s`, follows
  /// `path` in time. Times must not decrease.
  Actuation follow(const Path& path, const Motion& motion, double motion_s, double now_s);
  /// The command that follows the path's line and decelerates to a stop.
  Actuation brake(const Path& path, const Motion& motion, double motion_s, double now_s,
                  double deceleration_mps2);
  /// The command that keeps the vehicle at rest.
  Actuation hold(double now_s);
  /// Where the vehicle is after it drove on for this long, with the speed and steering of `motion`.
  [[nodiscard]] Motion move_on(const Motion& motion, double passed_s) const;
  /// Resets the state, because a driver has taken control and the vehicle's commands are unknown.
  void forget();

  [[nodiscard]] const TrackingError& error() const { return memory_.error; }

  [[nodiscard]] const Memory& memory() const { return memory_; }
  /// Restores a saved state.
  void set_memory(Memory memory) { memory_ = std::move(memory); }

 private:
  [[nodiscard]] const Actuation* command_at(double time_s) const;
  [[nodiscard]] Motion rear_axle(const Motion& centre) const;
  [[nodiscard]] Motion centre(const Motion& rear_axle) const;
  void roll(Motion& rear_axle, double step_s) const;
  [[nodiscard]] Motion predict(const Motion& motion, double from_s, double to_s) const;
  [[nodiscard]] double steering(const Reference& reference, const Motion& motion);
  void integrate(const Motion& motion, double passed_s);
  Actuation give(Actuation wanted, double now_s);

  const TrackerConfig config_;
  Memory memory_;
};

}  // namespace ads

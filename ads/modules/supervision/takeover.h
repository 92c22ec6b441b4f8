#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "supervision/state.pb.h"

namespace ads {

/// The state of the driver's controls at one moment.
struct DriverAction {
  double time_s = 0.0;
  double steering_torque_nm = 0.0;  ///< Left positive.
  double brake_pedal = 0.0;         ///< 0 to 1.
  bool has_pressed_button = false;
};

/// Detects that the driver takes over: by the button, the brake pedal, or a lasting torque on the
/// steering wheel.
///
/// @threads  Confined.
class Takeover {
 public:
  struct Limits {
    double steering_torque_nm = 3.0;
    /// The minimum duration of the torque: a bump in the road is shorter.
    double steering_time_s = 0.03;
    double brake_pedal = 0.05;
  };
  struct Finding {
    supervision::TakeoverCause cause = supervision::TAKEOVER_NONE;
    std::string reason;  ///< As text, with the measured value and its limit.
  };

  explicit Takeover(const Limits& limits) : limits_(limits) {}

  /// Processes the next action; returns a finding if the driver takes over by it.
  std::optional<Finding> look_at(const DriverAction& action);

  /// The time since which the torque has exceeded its limit.
  [[nodiscard]] std::optional<double> torque_since_s() const { return torque_since_s_; }
  void set_torque_since_s(std::optional<double> time_s) { torque_since_s_ = time_s; }

 private:
  Limits limits_;
  std::optional<double> torque_since_s_;
};

}  // namespace ads

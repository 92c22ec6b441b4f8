#include "takeover.h"

#include <cmath>

#include <fmt/format.h>

namespace ads {

std::optional<Takeover::Finding> Takeover::look_at(const DriverAction& action) {
  const double torque_nm = std::abs(action.steering_torque_nm);
  if (torque_nm > limits_.steering_torque_nm) {
    torque_since_s_ = torque_since_s_.value_or(action.time_s);
  } else {
    torque_since_s_.reset();
  }
  if (action.has_pressed_button) {
    return Finding{.cause = supervision::TAKEOVER_BUTTON,
                   .reason = "the driver took over: by the button"};
  }
  if (action.brake_pedal > limits_.brake_pedal) {
    return Finding{.cause = supervision::TAKEOVER_BRAKE,
                   .reason = fmt::format(
                       "the driver took over: the brake pedal is pressed by {:.0f} %, more than "
                       "{:.0f}",
                       1e2 * action.brake_pedal, 1e2 * limits_.brake_pedal)};
  }
  // Times of messages are rounded to nanoseconds.
  constexpr double kRounding_s = 1e-6;
  if (torque_since_s_ &&
      action.time_s - *torque_since_s_ >= limits_.steering_time_s - kRounding_s) {
    return Finding{
        .cause = supervision::TAKEOVER_STEERING,
        .reason = fmt::format(
            "the driver took over: {:.1f} Nm on the steering wheel for {:.0f} ms, more "
            "than {:.1f}",
            torque_nm, 1e3 * (action.time_s - *torque_since_s_), limits_.steering_torque_nm)};
  }
  return std::nullopt;
}

}  // namespace ads

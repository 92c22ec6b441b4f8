#include "tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/scalar.h"
#include "control_tuning.h"

namespace ads {
namespace {

double wrapped(double angle_rad) {
  return std::remainder(angle_rad, 2.0 * std::numbers::pi);
}

Reference between(const Reference& from, const Reference& to, double share) {
  return {.x_m = mix(from.x_m, to.x_m, share),
          .y_m = mix(from.y_m, to.y_m, share),
          .heading_rad = from.heading_rad + share * wrapped(to.heading_rad - from.heading_rad),
          .curvature_per_m = mix(from.curvature_per_m, to.curvature_per_m, share),
          .speed_mps = mix(from.speed_mps, to.speed_mps, share),
          .acceleration_mps2 = mix(from.acceleration_mps2, to.acceleration_mps2, share)};
}

}  // namespace

Reference Path::at(double time_s) const {
  const double last = static_cast<double>(points.size() - 1);
  const double place = (time_s - start_s) / step_s;
  if (place <= 0.0) {
    return points.front();
  }
  if (place >= last) {
    Reference end = points.back();
    // Beyond its end the path goes on as it ended.
    const double way = (place - last) * step_s * end.speed_mps;
    end.x_m += way * std::cos(end.heading_rad);
    end.y_m += way * std::sin(end.heading_rad);
    end.acceleration_mps2 = 0.0;
    end.curvature_per_m = 0.0;
    return end;
  }
  const auto index = static_cast<std::size_t>(place);
  return between(points[index], points[index + 1], place - static_cast<double>(index));
}

Reference Path::nearest(double x_m, double y_m) const {
  Reference best = points.front();
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t index = 0; index + 1 < points.size(); ++index) {
    const Reference& from = points[index];
    const Reference& to = points[index + 1];
    const double dx = to.x_m - from.x_m;
    const double dy = to.y_m - from.y_m;
    const double square = dx * dx + dy * dy;
    if (square < 1e-6) {
      continue;
    }
    double share = ((x_m - from.x_m) * dx + (y_m - from.y_m) * dy) / square;
    const bool is_last = index + 2 == points.size();
    share = std::clamp(share, 0.0, is_last ? 100.0 : 1.0);
    const double distance = std::hypot(from.x_m + share * dx - x_m, from.y_m + share * dy - y_m);
    if (distance < smallest) {
      smallest = distance;
      best = between(from, to, std::min(share, 1.0));
      best.x_m = from.x_m + share * dx;
      best.y_m = from.y_m + share * dy;
    }
  }
  return best;
}

// The last command before that time; null before the first one.
const Actuation* Tracker::command_at(double time_s) const {
  const Actuation* command = nullptr;
  for (const Past& past : memory_.past) {
    if (past.time_s > time_s + 1e-9) {
      break;
    }
    command = &past.command;
  }
  return command;
}

Motion Tracker::rear_axle(const Motion& centre) const {
  Motion axle = centre;
  axle.x_m -= config_.centre_to_rear_axle_m * std::cos(axle.heading_rad);
  axle.y_m -= config_.centre_to_rear_axle_m * std::sin(axle.heading_rad);
  return axle;
}

Motion Tracker::centre(const Motion& rear_axle) const {
  Motion centre = rear_axle;
  centre.x_m += config_.centre_to_rear_axle_m * std::cos(centre.heading_rad);
  centre.y_m += config_.centre_to_rear_axle_m * std::sin(centre.heading_rad);
  return centre;
}

// A step of the kinematic single-track model.
void Tracker::roll(Motion& rear_axle, double step_s) const {
  const double yaw = rear_axle.speed_mps * std::tan(rear_axle.steering_rad) / config_.wheelbase_m;
  const double heading = rear_axle.heading_rad + 0.5 * step_s * yaw;
  rear_axle.x_m += step_s * rear_axle.speed_mps * std::cos(heading);
  rear_axle.y_m += step_s * rear_axle.speed_mps * std::sin(heading);
  rear_axle.heading_rad += step_s * yaw;
}

Motion Tracker::move_on(const Motion& motion, double passed_s) const {
  Motion axle = rear_axle(motion);
  roll(axle, passed_s);
  return centre(axle);
}

// With the commands that are on their way.
Motion Tracker::predict(const Motion& motion, double from_s, double to_s) const {
  Motion now = rear_axle(motion);
  for (double time = from_s; time < to_s - 1e-9; time += kTracker.prediction_step_s) {
    const double step = std::min(kTracker.prediction_step_s, to_s - time);
    if (const Actuation* asked = command_at(time - config_.acceleration_delay_s)) {
      const double share =
          config_.acceleration_lag_s > step ? step / config_.acceleration_lag_s : 1.0;
      now.acceleration_mps2 += share * (asked->acceleration_mps2 - now.acceleration_mps2);
    }
    if (const Actuation* asked = command_at(time - config_.steering_delay_s)) {
      const double turn = config_.steering_rate_max_radps * step;
      now.steering_rad += std::clamp(asked->steering_rad - now.steering_rad, -turn, turn);
    }
    roll(now, step);
    now.speed_mps = std::max(0.0, now.speed_mps + step * now.acceleration_mps2);
  }
  return centre(now);
}

double Tracker::steering(const Reference& reference, const Motion& motion) {
  TrackingError& error = memory_.error;
  const double lever = config_.centre_to_rear_axle_m;
  const double cosine = std::cos(reference.heading_rad);
  const double sine = std::sin(reference.heading_rad);
  // At the rear axle, whose motion has no part across the heading.
  const double dx =
      motion.x_m - lever * std::cos(motion.heading_rad) - (reference.x_m - lever * cosine);
  const double dy =
      motion.y_m - lever * std::sin(motion.heading_rad) - (reference.y_m - lever * sine);
  error.along_m = dx * cosine + dy * sine;
  error.lateral_m = -dx * sine + dy * cosine;
  error.heading_rad = wrapped(motion.heading_rad - reference.heading_rad);
  error.speed_mps = motion.speed_mps - reference.speed_mps;
  // A longitudinal error along a curve is not a lateral one.
  const double bend = 0.5 * reference.curvature_per_m * error.along_m * error.along_m;
  error.lateral_m -= bend;
  error.heading_rad -= reference.curvature_per_m * error.along_m;
  const double length =
      std::max(config_.lateral_length_m, config_.lateral_time_s * motion.speed_mps);
  const double curvature = reference.curvature_per_m + memory_.curvature_per_m -
                           error.lateral_m / (length * length) -
                           2.0 * config_.lateral_damping * std::sin(error.heading_rad) / length;
  return std::atan(config_.wheelbase_m * curvature);
}

// A lasting error is not one of a manoeuvre but of the model: wheels that turn the vehicle less, a
// slope, a heavier load. With lengths in units of L the lateral error obeys the third derivative of
// e + 2 d times the second + the first + g e = 0, which is stable up to g = 2 d (Routh); along,
// with gains p and v, its third + v times the second + p times the first + g e = 0, stable up to g
// = v p.
void Tracker::integrate(const Motion& motion, double passed_s) {
  const TrackingError& error = memory_.error;
  const bool may_last = motion.speed_mps > kTracker.moving_mps &&
                        std::abs(error.lateral_m) < kTracker.lasting_lateral_m &&
                        std::abs(error.along_m) < kTracker.lasting_along_m &&
                        std::abs(error.speed_mps) < kTracker.lasting_speed_mps;
  if (!may_last) {  // Nor if one of them is no number.
    return;
  }
  const double length =
      std::max(config_.lateral_length_m, config_.lateral_time_s * motion.speed_mps);
  const double lateral_gain =
      config_.lateral_integral * 2.0 * config_.lateral_damping / (length * length * length);
  memory_.curvature_per_m = std::clamp(
      memory_.curvature_per_m - lateral_gain * error.lateral_m * motion.speed_mps * passed_s,
      -config_.lateral_integral_max_per_m, config_.lateral_integral_max_per_m);
  const double along_gain =
      config_.along_integral * config_.speed_gain_per_s * config_.position_gain_per_s2;
  memory_.acceleration_mps2 =
      std::clamp(memory_.acceleration_mps2 - along_gain * error.along_m * passed_s,
                 -config_.along_integral_max_mps2, config_.along_integral_max_mps2);
}

Actuation Tracker::give(Actuation wanted, double now_s) {
  std::deque<Past>& past = memory_.past;
  if (!std::isfinite(wanted.steering_rad) || !std::isfinite(wanted.acceleration_mps2)) {
    wanted = past.empty() ? Actuation{} : past.back().command;
  }
  if (!past.empty()) {
    const Past& last = past.back();
    const double passed = std::clamp(now_s - last.time_s, 0.0, 0.1);
    const double turn = config_.steering_rate_max_radps * passed;
    const double jerk = config_.jerk_max_mps3 * passed;
    wanted.steering_rad = std::clamp(wanted.steering_rad, last.command.steering_rad - turn,
                                     last.command.steering_rad + turn);
    wanted.acceleration_mps2 =
        std::clamp(wanted.acceleration_mps2, last.command.acceleration_mps2 - jerk,
                   last.command.acceleration_mps2 + jerk);
  }
  wanted.steering_rad =
      std::clamp(wanted.steering_rad, -config_.steering_max_rad, config_.steering_max_rad);
  wanted.acceleration_mps2 = std::clamp(wanted.acceleration_mps2, config_.acceleration_min_mps2,
                                        config_.acceleration_max_mps2);
  past.push_back({now_s, wanted});
  while (past.size() > 2 && past[1].time_s < now_s - kTracker.remembered_s) {
    past.pop_front();
  }
  return wanted;
}

Actuation Tracker::follow(const Path& path, const Motion& motion, double motion_s, double now_s) {
  const double effect_s = now_s + config_.steering_delay_s;
  const Motion then = predict(motion, motion_s, effect_s);
  Actuation wanted;
  wanted.steering_rad = steering(path.at(effect_s), then);
  // Compensates for the lag.
  const Reference ahead =
      path.at(now_s + config_.acceleration_delay_s + config_.acceleration_lag_s);
  const double last_s = memory_.past.empty() ? now_s : memory_.past.back().time_s;
  integrate(then, std::clamp(now_s - last_s, 0.0, kTracker.integral_step_max_s));
  wanted.acceleration_mps2 = ahead.acceleration_mps2 + memory_.acceleration_mps2 -
                             config_.speed_gain_per_s * memory_.error.speed_mps -
                             config_.position_gain_per_s2 * memory_.error.along_m;
  const bool ends_standing =
      ahead.speed_mps < kTracker.standing_mps && ahead.acceleration_mps2 < 0.1;
  if (ends_standing && then.speed_mps < kTracker.standing_mps) {
    wanted.acceleration_mps2 = std::min(wanted.acceleration_mps2, kTracker.holding_mps2);
  }
  return give(wanted, now_s);
}

Actuation Tracker::brake(const Path& path, const Motion& motion, double motion_s, double now_s,
                         double deceleration_mps2) {
  const Motion then = predict(motion, motion_s, now_s + config_.steering_delay_s);
  Reference reference = path.nearest(then.x_m, then.y_m);
  reference.speed_mps = then.speed_mps;
  Actuation wanted;
  wanted.steering_rad = steering(reference, then);
  wanted.acceleration_mps2 = -deceleration_mps2;
  return give(wanted, now_s);
}

Actuation Tracker::hold(double now_s) {
  memory_.error = {};
  const double steering = memory_.past.empty() ? 0.0 : memory_.past.back().command.steering_rad;
  return give({.steering_rad = steering, .acceleration_mps2 = kTracker.holding_mps2}, now_s);
}

void Tracker::forget() {
  memory_ = {};
}

}  // namespace ads

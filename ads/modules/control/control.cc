#include "control.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "control_tuning.h"
#include "controller_state.h"

namespace ads {
namespace {

fastcycle::ParamOptions<double> positive(double fallback, std::string unit,
                                         std::string description) {
  return {.fallback = fallback,
          .min = 0.0,
          .max = 100.0,
          .unit = std::move(unit),
          .description = std::move(description)};
}

TrackerConfig read_config(fastcycle::Context& context) {
  const TrackerConfig standard;
  const auto value = [&context](std::string_view name, double fallback, std::string unit,
                                std::string description) {
    return context.param<double>(name, positive(fallback, std::move(unit), std::move(description)))
        .get();
  };
  TrackerConfig config;
  config.wheelbase_m =
      value("wheelbase_m", standard.wheelbase_m, "m", "Distance between the axles");
  config.centre_to_rear_axle_m = value("centre_to_rear_axle_m", standard.centre_to_rear_axle_m, "m",
                                       "Distance from the box's centre back to the rear axle");
  config.steering_max_rad = value("steering_max_rad", standard.steering_max_rad, "rad",
                                  "Maximum steering angle to each side");
  config.steering_rate_max_radps =
      value("steering_rate_max_radps", standard.steering_rate_max_radps, "rad/s",
            "Maximum steering rate of the front wheels");
  config.acceleration_min_mps2 = -value("braking_max_mps2", -standard.acceleration_min_mps2,
                                        "m/s^2", "The hardest braking that is asked for");
  config.acceleration_max_mps2 = value("acceleration_max_mps2", standard.acceleration_max_mps2,
                                       "m/s^2", "The strongest acceleration that is asked for");
  config.jerk_max_mps3 = value("jerk_max_mps3", standard.jerk_max_mps3, "m/s^3",
                               "How fast the asked acceleration changes");
  config.steering_delay_s = value("steering_delay_s", standard.steering_delay_s, "s",
                                  "Delay from a command until the wheels turn");
  config.acceleration_delay_s = value("acceleration_delay_s", standard.acceleration_delay_s, "s",
                                      "Delay from a command until the vehicle accelerates");
  config.acceleration_lag_s = value("acceleration_lag_s", standard.acceleration_lag_s, "s",
                                    "Time constant of the acceleration after the delay");
  config.lateral_length_m = value("lateral_length_m", standard.lateral_length_m, "m",
                                  "Minimum distance over which lateral errors decay");
  config.lateral_time_s = value("lateral_time_s", standard.lateral_time_s, "s",
                                "Minimum time within which lateral errors decay");
  config.lateral_damping =
      value("lateral_damping", standard.lateral_damping, "1", "Damping of lateral errors");
  config.position_gain_per_s2 = value("position_gain_per_s2", standard.position_gain_per_s2,
                                      "1/s^2", "Acceleration for each metre too far behind");
  config.speed_gain_per_s = value("speed_gain_per_s", standard.speed_gain_per_s, "1/s",
                                  "Acceleration per m/s of speed error");
  config.lateral_integral = value(
      "lateral_integral", standard.lateral_integral, "1",
      "Integral gain for lateral errors, as a share of the gain that causes instability; 0: off");
  config.along_integral = value("along_integral", standard.along_integral, "1",
                                "Integral gain for longitudinal errors, likewise");
  return config;
}

bool is_finite(const planning::TrajectoryPoint& point) {
  return std::isfinite(point.x_m()) && std::isfinite(point.y_m()) &&
         std::isfinite(point.heading_rad()) && std::isfinite(point.curvature_per_m()) &&
         std::isfinite(point.speed_mps()) && std::isfinite(point.acceleration_mps2());
}

// Empty if it is no trajectory that can be followed.
Path path_of(const planning::Trajectory& trajectory, double start_s) {
  Path path{.start_s = start_s, .points = {}};
  for (const planning::TrajectoryPoint& point : trajectory.points()) {
    if (!is_finite(point)) {
      return {};
    }
    path.points.push_back({.x_m = point.x_m(),
                           .y_m = point.y_m(),
                           .heading_rad = point.heading_rad(),
                           .curvature_per_m = point.curvature_per_m(),
                           .speed_mps = point.speed_mps(),
                           .acceleration_mps2 = point.acceleration_mps2()});
  }
  if (trajectory.points_size() > 1) {
    path.step_s = trajectory.points(1).time_s() - trajectory.points(0).time_s();
  }
  return path.step_s > 0.0 ? path : Path{};
}

// When the vehicle stands, on such a path.
double end_s(const Path& path) {
  const auto standing = std::ranges::find_if(
      path.points, [](const Reference& at) { return at.speed_mps < kControl.standing_mps; });
  return path.start_s + path.step_s * static_cast<double>(standing - path.points.begin());
}

bool is_stopping(supervision::DrivingState state) {
  return state == supervision::MINIMAL_RISK_STOP || state == supervision::STOPPED;
}

bool is_autonomous(supervision::DrivingState state) {
  return state == supervision::ENGAGED || state == supervision::ENGAGED_DEGRADED ||
         is_stopping(state);
}

}  // namespace

Control::Control(fastcycle::Context& context)
    : Component(context),
      plan_age_s_(context.param<double>(
          "plan_age_s", positive(0.5, "s", "Maximum age of a plan that is followed in time"))),
      stale_braking_mps2_(context.param<double>(
          "stale_braking_mps2", positive(3.0, "m/s^2", "How the vehicle then stops on its line"))),
      supervision_age_s_(context.param<double>(
          "supervision_age_s",
          positive(0.2, "s", "Time without supervision messages after which the vehicle stops"))),
      tracker_(read_config(context)),
      plans_(context.create_latest<planning::Plan>("planning/checked_plan")),
      egos_(context.create_latest<localization::Ego>("localization/ego")),
      vehicle_states_(context.create_latest<vehicle::State>("vehicle/state")),
      states_(context.create_latest<supervision::State>("supervision/state")),
      commands_(context.create_publisher<control::Command>("control/command")),
      state_(context.state<control::ControllerState>("controller",
                                                     [this](auto& state) { save(state); })) {
  load(*state_);
}

void Control::save(control::ControllerState& state) const {
  if (!first_ns_) {
    return;
  }
  state.set_first_ns(*first_ns_);
  write(tracker_.memory(), *state.mutable_tracker());
  if (place_) {
    write(*place_, *state.mutable_place());
    state.set_place_ns(place_ns_);
    state.set_ego_ns(ego_ns_);
  }
  state.set_plan_sequence(plan_sequence_);
  state.set_plan_s(plan_s_);
  if (!nominal_.points.empty()) {
    write(nominal_, *state.mutable_nominal());
    write(minimal_risk_, *state.mutable_minimal_risk());
  }
  if (stop_) {
    write(*stop_, *state.mutable_stop());
  }
  state.set_lateral_error_max_m(lateral_error_max_m_);
  state.set_along_error_max_m(along_error_max_m_);
  state.set_commands_stale(commands_stale_);
}

void Control::load(const control::ControllerState& state) {
  if (!state.has_first_ns()) {
    return;  // It begins.
  }
  first_ns_ = state.first_ns();
  tracker_.set_memory(read(state.tracker()));
  if (state.has_place()) {
    place_ = read(state.place());
    place_ns_ = state.place_ns();
    ego_ns_ = state.ego_ns();
  }
  plan_sequence_ = state.plan_sequence();
  plan_s_ = state.plan_s();
  if (state.has_nominal()) {
    nominal_ = read(state.nominal());
    minimal_risk_ = read(state.minimal_risk());
  }
  if (state.has_stop()) {
    stop_ = read(state.stop());
  }
  lateral_error_max_m_ = state.lateral_error_max_m();
  along_error_max_m_ = state.along_error_max_m();
  commands_stale_ = state.commands_stale();
}

void Control::stop() {
  report("lateral_error_max_m", lateral_error_max_m_);
  report("along_error_max_m", along_error_max_m_);
  report("commands_stale", commands_stale_);
}

double Control::seconds(std::int64_t ns) const {
  return 1e-9 * static_cast<double>(ns - first_ns_.value_or(0));
}

// A minimal-risk stop takes seconds, and must not leave the road because localization has failed.
void Control::locate() {
  const auto ego = egos_.get();
  if (ego && ego->quality() != localization::INITIALIZING && ego->header().taken_ns() > ego_ns_ &&
      std::isfinite(ego->x_m() + ego->y_m() + ego->heading_rad() + ego->speed_mps())) {
    ego_ns_ = place_ns_ = ego->header().taken_ns();
    place_ = {.x_m = ego->x_m(),
              .y_m = ego->y_m(),
              .heading_rad = ego->heading_rad(),
              .speed_mps = ego->speed_mps()};
    return;
  }
  const auto vehicle = vehicle_states_.get();
  if (!place_ || !vehicle || vehicle->header().taken_ns() < ego_ns_ + kControl.silent_ns ||
      vehicle->header().taken_ns() <= place_ns_ ||
      !std::isfinite(vehicle->speed_mps() + vehicle->steering_rad())) {
    return;
  }
  place_->speed_mps = vehicle->speed_mps();
  place_->steering_rad = vehicle->steering_rad();
  place_ = tracker_.move_on(*place_,
                            1e-9 * static_cast<double>(vehicle->header().taken_ns() - place_ns_));
  place_ns_ = vehicle->header().taken_ns();
}

// None while it is not known, or not a number.
std::optional<Motion> Control::motion() const {
  if (!place_) {
    return std::nullopt;
  }
  const auto vehicle = vehicle_states_.get();
  Motion motion = *place_;
  motion.acceleration_mps2 = vehicle ? vehicle->acceleration_mps2() : 0.0;
  motion.steering_rad = vehicle ? vehicle->steering_rad() : 0.0;
  return std::isfinite(motion.acceleration_mps2 + motion.steering_rad) ? std::optional(motion)
                                                                       : std::nullopt;
}

void Control::take_plan(const Motion& motion, double now_s) {
  const auto plan = plans_.get();
  if (!plan || plan.info().sequence == plan_sequence_) {
    return;
  }
  plan_sequence_ = plan.info().sequence;
  Path nominal = path_of(plan->nominal(), seconds(plan->nominal().start_ns()));
  Path stop = path_of(plan->minimal_risk(), seconds(plan->minimal_risk().start_ns()));
  if (nominal.points.empty() || stop.points.empty()) {
    return;
  }
  plan_s_ = now_s;
  nominal_ = std::move(nominal);
  minimal_risk_ = std::move(stop);
  if (stop_ && is_better_stop(motion, now_s)) {
    stop_ = minimal_risk_;
  }
}

// Whether the newest minimal-risk trajectory is better than the one that is followed. Each of them
// begins with a moment of driving on, so that taking every new one would never stop.
bool Control::is_better_stop(const Motion& motion, double now_s) const {
  const Reference begin = minimal_risk_.at(now_s);
  return end_s(minimal_risk_) <= end_s(*stop_) &&
         std::hypot(begin.x_m - motion.x_m, begin.y_m - motion.y_m) < kControl.same_place_m &&
         std::abs(begin.speed_mps - motion.speed_mps) < kControl.same_speed_mps;
}

Actuation Control::act(supervision::DrivingState state, const Motion& motion, double motion_s,
                       double now_s) {
  if (state == supervision::STOPPED) {
    return tracker_.hold(now_s);
  }
  if (state == supervision::MINIMAL_RISK_STOP) {
    if (!stop_) {
      stop_ = minimal_risk_;
    }
    return tracker_.follow(*stop_, motion, motion_s, now_s);
  }
  stop_.reset();
  if (now_s - plan_s_ > plan_age_s_.get()) {
    ++commands_stale_;
    return tracker_.brake(nominal_, motion, motion_s, now_s, stale_braking_mps2_.get());
  }
  return tracker_.follow(nominal_, motion, motion_s, now_s);
}

bool Control::is_supervision_silent() const {
  const auto age = states_.age();
  return age && std::chrono::duration<double>(*age).count() > supervision_age_s_.get();
}

void Control::serve() {
  const std::int64_t now_ns = now().time_since_epoch().count();
  if (!first_ns_) {
    first_ns_ = now_ns;
  }
  const double now_s = seconds(now_ns);
  locate();
  const std::optional<Motion> where = motion();
  if (where) {
    take_plan(*where, now_s);
  }
  const auto state = states_.get();
  auto driving = state ? state->state() : supervision::OFF;
  const bool is_alone = is_autonomous(driving) && is_supervision_silent();
  if (is_alone && driving != supervision::STOPPED) {
    driving = supervision::MINIMAL_RISK_STOP;
  }
  if (nominal_.points.empty()) {
    return;
  }
  if (!where) {
    // Blind: as before, and slower.
    publish(is_autonomous(driving) ? tracker_.hold(now_s) : Actuation{}, is_autonomous(driving),
            is_alone);
    return;
  }
  const double motion_s = seconds(place_ns_);
  if (!is_autonomous(driving)) {
    tracker_.forget();
    stop_.reset();
    publish(tracker_.follow(nominal_, *where, motion_s, now_s), false);
    tracker_.forget();
    return;
  }
  const Actuation actuation = act(driving, *where, motion_s, now_s);
  lateral_error_max_m_ = std::max(lateral_error_max_m_, std::abs(tracker_.error().lateral_m));
  along_error_max_m_ = std::max(along_error_max_m_, std::abs(tracker_.error().along_m));
  publish(actuation, true, is_alone);
}

void Control::publish(const Actuation& actuation, bool is_autonomous, bool is_alone) {
  auto command = commands_.loan();
  command->mutable_header()->set_taken_ns(now().time_since_epoch().count());
  command->set_steering_rad(actuation.steering_rad);
  command->set_acceleration_mps2(actuation.acceleration_mps2);
  command->set_is_autonomous(is_autonomous);
  command->set_is_stopping_alone(is_alone);
  const TrackingError& error = tracker_.error();
  command->set_lateral_error_m(error.lateral_m);
  command->set_heading_error_rad(error.heading_rad);
  command->set_speed_error_mps(error.speed_mps);
  commands_.publish(std::move(command));
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Control)

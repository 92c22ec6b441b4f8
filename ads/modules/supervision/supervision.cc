#include "supervision.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "common/plane.h"

namespace ads {
namespace {

fastcycle::Time time_of(std::int64_t ns) {
  return fastcycle::Time(fastcycle::Duration(ns));
}

bool is_finite(const localization::Ego& ego) {
  return std::isfinite(ego.x_m()) && std::isfinite(ego.y_m()) && std::isfinite(ego.heading_rad()) &&
         std::isfinite(ego.speed_mps()) && std::isfinite(ego.acceleration_mps2());
}

bool is_finite(const vehicle::DriverInput& input) {
  return std::isfinite(input.steering_torque_nm()) && std::isfinite(input.brake_pedal());
}

Takeover::Limits read_takeover_limits(fastcycle::Context& context) {
  const Takeover::Limits usual;
  const auto read = [&context](std::string_view name, double fallback, double max, std::string unit,
                               std::string description) {
    return context
        .param<double>(name, {.fallback = fallback,
                              .min = 0.0,
                              .max = max,
                              .unit = std::move(unit),
                              .description = std::move(description)})
        .get();
  };
  return {.steering_torque_nm = read("takeover.steering_torque_nm", usual.steering_torque_nm, 9.5,
                                     "Nm", "Steering torque above which the driver takes over"),
          .steering_time_s = read("takeover.steering_time_s", usual.steering_time_s, 0.08, "s",
                                  "Duration of that torque until the driver takes over"),
          .brake_pedal = read("takeover.brake_pedal", usual.brake_pedal, 1.0, "1",
                              "Brake pedal position above which the driver takes over")};
}

}  // namespace

fastcycle::Param<double> Supervision::limit(std::string_view name, double fallback_s) {
  return context().param<double>(std::string(name),
                                 {.fallback = fallback_s,
                                  .min = 0.001,
                                  .max = 60.0,
                                  .unit = "s",
                                  .description = "Maximum age; older inputs count as missing"});
}

Supervision::Supervision(fastcycle::Context& context)
    : Component(context),
      essential_(context.param<std::vector<std::string>>(
          "essential",
          {.fallback = std::vector<std::string>{},
           .description = "Components whose failure ends autonomous driving immediately"})),
      ego_length_m_(context.param<double>(
          "ego_length_m", {.fallback = 4.508, .min = 0.5, .max = 30.0, .unit = "m"})),
      ego_width_m_(context.param<double>("ego_width_m",
                                         {.fallback = 1.610, .min = 0.5, .max = 5.0, .unit = "m"})),
      invalid_sweeps_s_(context.param<double>(
          "invalid_sweeps_s",
          {.fallback = 0.25,
           .min = 0.0,
           .max = 10.0,
           .unit = "s",
           .description = "Time without a usable sweep after which the vehicle stops"})),
      no_plan_s_(context.param<double>(
          "no_plan_s",
          {.fallback = 1.5,
           .min = 0.0,
           .max = 10.0,
           .unit = "s",
           .description = "Time with only stopping plans after which the vehicle stops"})),
      rejected_plans_max_(context.param<int>(
          "rejected_plans_max",
          {.fallback = 3,
           .min = 1,
           .max = 100,
           .description = "Number of consecutive rejected plans after which the vehicle stops"})),
      states_(context.create_publisher<supervision::State>("supervision/state")),
      state_(context.state<supervision::SupervisorState>("supervisor",
                                                         [this](auto& state) { save(state); })),
      ego_input_{"the ego pose", limit("ego_age_s", 0.1), {}},
      objects_input_{"the newest look at the objects", limit("objects_age_s", 0.4), {}},
      plan_input_{"the last accepted plan", limit("plan_age_s", 0.5), {}},
      command_input_{"the newest command", limit("command_age_s", 0.15), {}},
      vehicle_input_{"the vehicle's own state", limit("vehicle_age_s", 0.1), {}},
      driver_age_s_(context.param<double>(
          "driver_age_s",
          {.fallback = 0.0,
           .min = 0.0,
           .max = 60.0,
           .unit = "s",
           .description =
               "Maximum age of driver inputs; older ones count as missing; 0: no driver"})),
      takeover_(read_takeover_limits(context)) {
  load(*state_);
  context.create_subscriber<fastcycle::status::Status>(
      "fastcycle/status", [this](const fastcycle::status::Status& status) { on_status(status); });
  context.create_subscriber<localization::Ego>(
      "localization/ego", [this](const localization::Ego& ego) { on_ego(ego); });
  context.create_subscriber<perception::Objects>(
      "perception/objects", [this](const perception::Objects& objects) { on_objects(objects); });
  context.create_subscriber<planning::Plan>("planning/checked_plan",
                                            [this](const planning::Plan& plan) { on_plan(plan); });
  context.create_subscriber<planning::PlanVerdict>(
      "planning/verdict", [this](const planning::PlanVerdict& verdict) { on_verdict(verdict); });
  context.create_subscriber<control::Command>(
      "control/command", [this](const control::Command& command) {
        command_input_.taken = time_of(command.header().taken_ns());
      });
  context.create_subscriber<vehicle::State>("vehicle/state", [this](const vehicle::State& state) {
    vehicle_input_.taken = time_of(state.header().taken_ns());
  });
  context.create_subscriber<vehicle::DriverInput>(
      "vehicle/driver", [this](const vehicle::DriverInput& input) { on_driver(input); });
  context.create_subscriber<mission::Goal>("mission/goal",
                                           [this](const mission::Goal& goal) { on_goal(goal); });
}

void Supervision::save(supervision::SupervisorState& state) const {
  driving_.save(*state.mutable_driving());
  const auto write_time = [&state](const std::optional<fastcycle::Time>& time, auto set) {
    if (time) {
      (state.*set)(time->time_since_epoch().count());
    }
  };
  using Memory = supervision::SupervisorState;
  write_time(ego_input_.taken, &Memory::set_ego_taken_ns);
  write_time(objects_input_.taken, &Memory::set_objects_taken_ns);
  write_time(plan_input_.taken, &Memory::set_plan_taken_ns);
  write_time(command_input_.taken, &Memory::set_command_taken_ns);
  write_time(vehicle_input_.taken, &Memory::set_vehicle_taken_ns);
  write_time(engage_at_, &Memory::set_engage_at_ns);
  write_time(driver_taken_, &Memory::set_driver_taken_ns);
  write_time(taken_over_, &Memory::set_taken_over_ns);
  if (takeover_.torque_since_s()) {
    state.set_torque_since_s(*takeover_.torque_since_s());
  }
  state.set_takeovers(takeovers_);
  write_time(sweeps_invalid_since_, &Memory::set_sweeps_invalid_since_ns);
  write_time(plan_missing_since_, &Memory::set_plan_missing_since_ns);
  write_time(last_look_, &Memory::set_last_look_ns);
  *state.mutable_ego() = ego_;
  state.set_sweep_reason(sweep_reason_);
  state.set_plan_reason(plan_reason_);
  state.set_plan_kind(plan_kind_);
  state.set_rejected_in_a_row(rejected_in_a_row_);
  state.set_rejection(rejection_);
  state.mutable_failures()->Assign(failures_.begin(), failures_.end());
  state.set_breach(breach_);
  for (const auto& [chain, count] : breaches_) {
    auto& breaches = *state.add_breaches();
    breaches.set_chain(chain);
    breaches.set_count(count);
  }
  for (const auto& [driving_state, duration_s] : seconds_in_) {
    auto& duration = *state.add_durations();
    duration.set_state(message_of(driving_state));
    duration.set_duration_s(duration_s);
  }
  state.set_smallest_gap_m(smallest_gap_m_);
}

void Supervision::load(const supervision::SupervisorState& state) {
  if (!state.has_driving()) {
    return;  // It begins.
  }
  driving_.load(state.driving());
  const auto read_time = [](bool is_there, std::int64_t ns) {
    return is_there ? std::optional(time_of(ns)) : std::nullopt;
  };
  ego_input_.taken = read_time(state.has_ego_taken_ns(), state.ego_taken_ns());
  objects_input_.taken = read_time(state.has_objects_taken_ns(), state.objects_taken_ns());
  plan_input_.taken = read_time(state.has_plan_taken_ns(), state.plan_taken_ns());
  command_input_.taken = read_time(state.has_command_taken_ns(), state.command_taken_ns());
  vehicle_input_.taken = read_time(state.has_vehicle_taken_ns(), state.vehicle_taken_ns());
  engage_at_ = read_time(state.has_engage_at_ns(), state.engage_at_ns());
  driver_taken_ = read_time(state.has_driver_taken_ns(), state.driver_taken_ns());
  taken_over_ = read_time(state.has_taken_over_ns(), state.taken_over_ns());
  takeover_.set_torque_since_s(state.has_torque_since_s() ? std::optional(state.torque_since_s())
                                                          : std::nullopt);
  takeovers_ = state.takeovers();
  sweeps_invalid_since_ =
      read_time(state.has_sweeps_invalid_since_ns(), state.sweeps_invalid_since_ns());
  plan_missing_since_ = read_time(state.has_plan_missing_since_ns(), state.plan_missing_since_ns());
  last_look_ = read_time(state.has_last_look_ns(), state.last_look_ns());
  ego_ = state.ego();
  sweep_reason_ = state.sweep_reason();
  plan_reason_ = state.plan_reason();
  plan_kind_ = state.plan_kind();
  rejected_in_a_row_ = state.rejected_in_a_row();
  rejection_ = state.rejection();
  failures_.assign(state.failures().begin(), state.failures().end());
  breach_ = state.breach();
  for (const auto& breaches : state.breaches()) {
    breaches_[breaches.chain()] = breaches.count();
  }
  for (const auto& duration : state.durations()) {
    seconds_in_[driving_state_of(duration.state())] = duration.duration_s();
  }
  smallest_gap_m_ = state.smallest_gap_m();
}

/// Since the vehicle was to drive by itself, once that is known.
double Supervision::seconds(fastcycle::Time time) const {
  return std::chrono::duration<double>(time - engage_at_.value_or(start_time())).count();
}

void Supervision::on_status(const fastcycle::status::Status& status) {
  failures_.clear();
  for (const auto& component : status.components()) {
    const bool is_essential =
        std::ranges::find(essential_.get(), component.name()) != essential_.get().end();
    const bool has_failed = component.state() == fastcycle::status::STATE_FAILED ||
                            component.state() == fastcycle::status::STATE_RESTARTING ||
                            component.health() == fastcycle::status::HEALTH_FAILED;
    if (is_essential && has_failed) {
      const std::string& why =
          component.last_fault().empty() ? component.health_reason() : component.last_fault();
      failures_.push_back(fmt::format("{} has failed: {}", component.name(), why));
    }
  }
  breach_.clear();
  for (const auto& chain : status.chains()) {
    std::uint64_t& before = breaches_[chain.name()];
    if (chain.breaches() > before) {
      breach_ = fmt::format("the chain {} was too slow", chain.name());
    }
    before = chain.breaches();
  }
}

void Supervision::on_ego(const localization::Ego& ego) {
  if (is_finite(ego)) {
    ego_ = ego;
    ego_input_.taken = time_of(ego.header().taken_ns());
  }
}

void Supervision::on_objects(const perception::Objects& objects) {
  objects_input_.taken = time_of(objects.header().taken_ns());
  if (objects.is_sweep_valid()) {
    sweeps_invalid_since_.reset();
  } else {
    sweeps_invalid_since_ = sweeps_invalid_since_.value_or(now());
    sweep_reason_ = objects.reason();
  }
  note_gap(objects);
}

void Supervision::on_plan(const planning::Plan& plan) {
  plan_input_.taken = time_of(plan.header().taken_ns());
  plan_kind_ = plan.kind();
  plan_reason_ = plan.reason();
  if (plan.kind() == planning::NONE) {
    plan_missing_since_ = plan_missing_since_.value_or(now());
  } else {
    plan_missing_since_.reset();
  }
}

// The vehicle is the driver's at once, and not with the next tick.
void Supervision::on_driver(const vehicle::DriverInput& input) {
  if (!is_finite(input)) {
    return;
  }
  driver_taken_ = time_of(input.header().taken_ns());
  const auto found = takeover_.look_at(
      {.time_s = std::chrono::duration<double>(*driver_taken_ - start_time()).count(),
       .steering_torque_nm = input.steering_torque_nm(),
       .brake_pedal = input.brake_pedal(),
       .has_pressed_button = input.takeover_button()});
  const DrivingState before = driving_.state();
  if (!found || !driving_.take_over(found->cause, found->reason, seconds(now()))) {
    return;
  }
  taken_over_ = now();
  ++takeovers_;
  count_time(before);
  report_change(before);
  publish();
}

void Supervision::on_verdict(const planning::PlanVerdict& verdict) {
  rejected_in_a_row_ = verdict.rejected_in_a_row();
  rejection_ = verdict.reason();
}

void Supervision::on_goal(const mission::Goal& goal) {
  engage_at_ = time_of(goal.engage_ns());
  if (taken_over_ && *engage_at_ > *taken_over_) {
    taken_over_.reset();
    driving_.ask_again();
  }
}

Observation Supervision::observe_now() const {
  const auto age_s = [this](const std::optional<fastcycle::Time>& time) {
    return time ? std::chrono::duration<double>(now() - *time).count()
                : std::numeric_limits<double>::infinity();
  };
  Observation observation;
  observation.time_s = seconds(now());
  observation.speed_mps = ego_.speed_mps();
  if (engage_at_) {
    observation.engage_at_s = 0.0;
  }
  for (const Input* input :
       {&ego_input_, &objects_input_, &plan_input_, &command_input_, &vehicle_input_}) {
    observation.inputs.push_back(
        {.what = input->what, .age_s = age_s(input->taken), .limit_s = input->limit_s.get()});
  }
  if (driver_age_s_.get() > 0.0) {
    observation.inputs.push_back({.what = "the newest of the driver's inputs",
                                  .age_s = age_s(driver_taken_),
                                  .limit_s = driver_age_s_.get()});
  }
  observation.failures = failures_;
  if (ego_.quality() == localization::LOST) {
    observation.failures.push_back("the position is lost: " + ego_.reason());
  }
  if (sweeps_invalid_since_ && age_s(sweeps_invalid_since_) > invalid_sweeps_s_.get()) {
    observation.failures.push_back("the lidar sweeps cannot be used: " + sweep_reason_);
  }
  if (plan_missing_since_ && age_s(plan_missing_since_) > no_plan_s_.get()) {
    observation.failures.push_back("there is no way but to stop: " + plan_reason_);
  }
  if (std::cmp_greater_equal(rejected_in_a_row_, rejected_plans_max_.get())) {
    observation.failures.push_back(
        fmt::format("{} plans in a row were rejected: {}", rejected_in_a_row_, rejection_));
  } else if (rejected_in_a_row_ > 0) {
    observation.weaknesses.push_back("a plan was rejected: " + rejection_);
  }
  if (ego_.quality() != localization::GOOD) {
    observation.weaknesses.push_back("the position is uncertain: " + ego_.reason());
  }
  if (sweeps_invalid_since_) {
    observation.weaknesses.push_back("a lidar sweep could not be used: " + sweep_reason_);
  }
  if (plan_kind_ != planning::NOMINAL) {
    observation.weaknesses.push_back("the plan is no comfortable one: " + plan_reason_);
  }
  if (!breach_.empty()) {
    observation.weaknesses.push_back(breach_);
  }
  return observation;
}

void Supervision::serve() {
  const Observation observation = observe_now();
  const DrivingState before = driving_.state();
  count_time(before);
  if (driving_.look_at(observation)) {
    report_change(before);
  }
  publish();
}

// Until now it was in `before`.
void Supervision::count_time(DrivingState before) {
  if (last_look_) {
    seconds_in_[before] += std::chrono::duration<double>(now() - *last_look_).count();
  }
  last_look_ = now();
}

void Supervision::report_change(DrivingState before) {
  const std::string text =
      fmt::format("{} → {}{}{}", to_string(before), to_string(driving_.state()),
                  driving_.reason().empty() ? "" : ": ", driving_.reason());
  driving_.state() == DrivingState::kMinimalRiskStop ? log().warning("{}", text)
                                                     : log().info("{}", text);
}

void Supervision::publish() {
  auto state = states_.loan();
  state->mutable_header()->set_taken_ns(now().time_since_epoch().count());
  state->set_state(message_of(driving_.state()));
  state->set_reason(driving_.reason());
  state->set_takeover(driving_.takeover());
  state->set_since_ns((engage_at_.value_or(start_time()).time_since_epoch() +
                       fastcycle::Duration(std::llround(driving_.since_s() * 1e9)))
                          .count());
  states_.publish(std::move(state));
}

void Supervision::note_gap(const perception::Objects& objects) {
  if (!ego_input_.taken || !engage_at_ || now() < *engage_at_) {
    return;
  }
  const Box ego{.center_m = {ego_.x_m(), ego_.y_m()},
                .heading_rad = ego_.heading_rad(),
                .length_m = ego_length_m_.get(),
                .width_m = ego_width_m_.get()};
  for (const perception::Object& object : objects.objects()) {
    const Box box{.center_m = {object.x_m(), object.y_m()},
                  .heading_rad = object.heading_rad(),
                  .length_m = object.length_m(),
                  .width_m = object.width_m()};
    if (std::isfinite(box.center_m.sum() + box.heading_rad + box.length_m + box.width_m)) {
      smallest_gap_m_ = std::min(smallest_gap_m_, distance_m(ego, box));
    }
  }
}

void Supervision::stop() {
  report("state", std::string(to_string(driving_.state())));
  report("reason", driving_.reason());
  report("takeovers", takeovers_);
  for (const DrivingState state : {DrivingState::kEngaged, DrivingState::kEngagedDegraded,
                                   DrivingState::kMinimalRiskStop, DrivingState::kStopped}) {
    std::string name = fmt::format("{}_s", to_string(state));
    std::ranges::replace(name, ' ', '_');
    std::ranges::replace(name, '-', '_');
    report(name, seconds_in_[state]);
  }
  if (std::isfinite(smallest_gap_m_)) {
    report("smallest_perceived_gap_m", smallest_gap_m_);
  }
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::Supervision)

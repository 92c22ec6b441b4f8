#include "motion_planning.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "messages.h"
#include "planner_state.h"

namespace motion_planning {
namespace {

double param(fastcycle::Context& context, std::string_view name, double fallback, double max,
             std::string unit, std::string description) {
  return context
      .param<double>(name, {.fallback = fallback,
                            .min = 1e-3,
                            .max = max,
                            .unit = std::move(unit),
                            .description = std::move(description)})
      .get();
}

Vehicle read_vehicle(fastcycle::Context& context) {
  const Vehicle standard;
  return {
      .length_m = param(context, "length_m", standard.length_m, 30.0, "m", "Of the vehicle's box"),
      .width_m = param(context, "width_m", standard.width_m, 5.0, "m", "Of the vehicle's box"),
      .wheelbase_m = param(context, "wheelbase_m", standard.wheelbase_m, 20.0, "m",
                           "Distance between the axles"),
      .centre_to_rear_axle_m =
          param(context, "centre_to_rear_axle_m", standard.centre_to_rear_axle_m, 20.0, "m",
                "Distance from the box's centre back to the rear axle"),
      .steering_max_rad = param(context, "steering_max_rad", standard.steering_max_rad, 1.4, "rad",
                                "Maximum steering angle of the front wheels, to each side"),
      .steering_rate_max_radps =
          param(context, "steering_rate_max_radps", standard.steering_rate_max_radps, 5.0, "rad/s",
                "Maximum steering rate of the front wheels")};
}

PlannerConfig read_config(fastcycle::Context& context, const Vehicle& vehicle) {
  const PlannerConfig standard;
  PlannerConfig config{.vehicle = vehicle};
  config.beam = static_cast<std::size_t>(
      context
          .param<std::int64_t>("beam", {.fallback = static_cast<std::int64_t>(standard.beam),
                                        .min = 1,
                                        .max = 5000,
                                        .description = "States per layer that the search keeps"})
          .get());
  config.horizon_min_s = param(context, "horizon_min_s", standard.horizon_min_s, 60.0, "s",
                               "Minimum planning horizon");
  config.horizon_max_s = param(context, "horizon_max_s", standard.horizon_max_s, 60.0, "s",
                               "Maximum planning horizon, when the goal is far");
  config.cruise_mps =
      param(context, "cruise_mps", standard.cruise_mps, 60.0, "m/s",
            "Speed where the map has no limit, unless others or the driver were faster");
  config.certain_s = param(context, "certain_s", standard.certain_s, 10.0, "s",
                           "Time within which a predicted collision causes evasion");
  return config;
}

planning::PlanKind kind_of(PlanKind kind) {
  switch (kind) {
    case PlanKind::kNominal:
      return planning::NOMINAL;
    case PlanKind::kEvasive:
      return planning::EVASIVE;
    case PlanKind::kNone:
      break;
  }
  return planning::NONE;
}

}  // namespace

MotionPlanning::MotionPlanning(fastcycle::Context& context)
    : Component(context),
      vehicle_(read_vehicle(context)),
      planner_(read_config(context, vehicle_)),
      egos_(context.create_latest<localization::Ego>("localization/ego")),
      vehicle_states_(context.create_latest<vehicle::State>("vehicle/state")),
      routes_(context.create_latest<hd_map::Route>("map/route")),
      tiles_(context.create_latest<hd_map::Tile>("map/tile")),
      goals_(context.create_latest<mission::Goal>("mission/goal")),
      plans_(context.create_publisher<planning::Plan>("planning/plan")),
      state_(
          context.state<planning::PlannerState>("planner", [this](auto& state) { save(state); })) {
  load(*state_);
  context.create_subscriber<prediction::Predictions>(
      "prediction/objects",
      [this](const prediction::Predictions& predictions) { on_predictions(predictions); });
}

void MotionPlanning::stop() {
  report("plans", plans_made_);
  report("plans_evasive", plans_evasive_);
  report("plans_to_goal", plans_to_goal_);
}

void MotionPlanning::save(planning::PlannerState& state) const {
  if (!first_ns_) {
    return;
  }
  state.set_first_ns(*first_ns_);
  write(planner_.memory(), state);
  state.set_plans(plans_made_);
  state.set_plans_evasive(plans_evasive_);
  state.set_plans_to_goal(plans_to_goal_);
}

void MotionPlanning::load(const planning::PlannerState& state) {
  if (!state.has_first_ns()) {
    return;  // It begins.
  }
  first_ns_ = state.first_ns();
  planner_.set_memory(read(state));
  plans_made_ = state.plans();
  plans_evasive_ = state.plans_evasive();
  plans_to_goal_ = state.plans_to_goal();
}

double MotionPlanning::seconds(std::int64_t ns) const {
  return 1e-9 * static_cast<double>(ns - first_ns_.value_or(0));
}

void MotionPlanning::update_road() {
  const auto route = routes_.get();
  const auto tile = tiles_.get();
  const std::uint64_t tile_sequence = tile ? tile.info().sequence : 0;
  if (!route || (route.info().sequence == route_sequence_ && tile_sequence == tile_sequence_)) {
    return;
  }
  route_sequence_ = route.info().sequence;
  tile_sequence_ = tile_sequence;
  road_ = road_of(*route, tile ? &*tile : nullptr);
  lanes_ = tile ? lanes_of(*tile) : std::vector<Road>();
  waiting_lines_ = tile ? waiting_lines_of(*route, *tile, road_) : std::vector<WaitingLine>();
  map_end_m_ = tile ? map_end_of(*tile, road_) : std::nullopt;
}

// The newest estimate, moved on to now.
State MotionPlanning::ego_now() const {
  const auto ego = egos_.get();
  const auto vehicle = vehicle_states_.get();
  const double age = std::clamp(
      seconds(now().time_since_epoch().count()) - seconds(ego->header().taken_ns()), 0.0, 0.5);
  State state{.x_m = ego->x_m(),
              .y_m = ego->y_m(),
              .heading_rad = ego->heading_rad(),
              .speed_mps = ego->speed_mps(),
              .acceleration_mps2 = ego->acceleration_mps2()};
  if (vehicle) {
    state.steering_rad = vehicle->steering_rad();
    state.acceleration_mps2 = vehicle->acceleration_mps2();
  }
  State then = drive(vehicle_, state, Input{}, age);
  then.speed_mps = std::max(0.0, then.speed_mps);
  return then;
}

std::optional<Goal> MotionPlanning::goal() const {
  const auto goal = goals_.get();
  const auto tile = tiles_.get();
  if (!goal) {
    return std::nullopt;
  }
  return goal_of(*goal, tile ? &*tile : nullptr, road_,
                 [this](std::int64_t ns) { return seconds(ns); });
}

Situation MotionPlanning::situation_of(const prediction::Predictions& predictions) const {
  const std::int64_t now_ns = now().time_since_epoch().count();
  const double now_s = seconds(now_ns);
  const auto vehicle = vehicle_states_.get();
  return {.now_s = now_s,
          .ego = ego_now(),
          .is_driving = vehicle && vehicle->is_autonomous(),
          .road = &road_,
          .lanes = &lanes_,
          .objects = objects_of(predictions, now_s - seconds(predictions.header().taken_ns())),
          .hazards = hazards_of(predictions, now_ns),
          .waiting_lines = waiting_lines_,
          .map_end_m = map_end_m_,
          .goal = goal()};
}

void MotionPlanning::on_predictions(const prediction::Predictions& predictions) {
  if (!first_ns_) {
    first_ns_ = now().time_since_epoch().count();
  }
  update_road();
  if (!egos_.get() || road_.is_empty()) {
    return;
  }
  const Situation situation = situation_of(predictions);
  const State& ego = situation.ego;
  if (!std::isfinite(ego.x_m + ego.y_m + ego.heading_rad + ego.speed_mps + ego.acceleration_mps2 +
                     ego.steering_rad)) {
    return;
  }
  publish(predictions, planner_.plan(situation));
}

void MotionPlanning::publish(const prediction::Predictions& predictions, const Plan& plan) {
  const std::int64_t now_ns = now().time_since_epoch().count();
  auto message = plans_.loan();
  *message->mutable_header() = predictions.header();
  message->set_kind(kind_of(plan.kind));
  write(vehicle_, plan.nominal, now_ns, *message->mutable_nominal());
  write(vehicle_, plan.minimal_risk, now_ns, *message->mutable_minimal_risk());
  if (plan.goal_s) {
    message->set_goal_ns(*first_ns_ + std::llround(1e9 * *plan.goal_s));
  }
  message->set_smallest_gap_m(plan.smallest_gap_m);
  message->set_candidates(static_cast<std::uint32_t>(plan.candidates));
  message->set_feasible(static_cast<std::uint32_t>(plan.feasible));
  message->set_reason(plan.reason);
  write(plan.binding_rules, *message->mutable_binding_rules());
  plans_.publish(std::move(message));

  ++plans_made_;
  plans_evasive_ += plan.kind == PlanKind::kNominal ? 0 : 1;
  plans_to_goal_ += plan.goal_s ? 1 : 0;
}

}  // namespace motion_planning

FASTCYCLE_COMPONENT(motion_planning::MotionPlanning)

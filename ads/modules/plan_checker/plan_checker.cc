#include "plan_checker.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "common/scalar.h"
#include "plan_checker_tuning.h"

namespace plan_checker {
namespace {

using ads::seconds_of;

Limits read_limits(fastcycle::Context& context) {
  Limits limits;
  const auto read = [&context](double& value, std::string_view name, double max, std::string unit,
                               std::string description) {
    value = context
                .param<double>(name, {.fallback = value,
                                      .min = 0.0,
                                      .max = max,
                                      .unit = std::move(unit),
                                      .description = std::move(description)})
                .get();
  };
  read(limits.length_m, "length_m", 30.0, "m", "Of the vehicle's box");
  read(limits.width_m, "width_m", 5.0, "m", "Of the vehicle's box");
  read(limits.wheelbase_m, "wheelbase_m", 20.0, "m", "Distance between the axles");
  read(limits.centre_to_rear_axle_m, "centre_to_rear_axle_m", 20.0, "m",
       "Distance from the box's centre back to the rear axle");
  read(limits.steering_max_rad, "steering_max_rad", 1.4, "rad",
       "Maximum steering angle of the front wheels");
  read(limits.steering_rate_max_radps, "steering_rate_max_radps", 5.0, "rad/s",
       "Maximum steering rate of the front wheels");
  read(limits.speed_max_mps, "speed_max_mps", 100.0, "m/s", "Maximum speed of the vehicle");
  read(limits.braking_max_mps2, "braking_max_mps2", 20.0, "m/s^2", "That tyres can hold");
  read(limits.acceleration_max_mps2, "acceleration_max_mps2", 20.0, "m/s^2",
       "That the vehicle can reach");
  read(limits.jerk_max_mps3, "jerk_max_mps3", 1000.0, "m/s^3", "That brakes can follow");
  read(limits.lateral_max_mps2, "lateral_max_mps2", 20.0, "m/s^2", "That tyres can hold");
  read(limits.comfort_braking_mps2, "comfort_braking_mps2", 20.0, "m/s^2",
       "Braking from which it is noted");
  read(limits.comfort_acceleration_mps2, "comfort_acceleration_mps2", 20.0, "m/s^2",
       "Acceleration from which it is noted");
  read(limits.comfort_jerk_mps3, "comfort_jerk_mps3", 1000.0, "m/s^3",
       "Jerk from which it is noted");
  read(limits.comfort_lateral_mps2, "comfort_lateral_mps2", 20.0, "m/s^2",
       "Lateral acceleration from which it is noted");
  read(limits.start_distance_max_m, "start_distance_max_m", 10.0, "m",
       "Maximum distance between the vehicle and its planned position");
  read(limits.start_heading_max_rad, "start_heading_max_rad", 3.2, "rad",
       "Maximum difference between the vehicle's heading and the plan's");
  read(limits.start_speed_max_mps, "start_speed_max_mps", 20.0, "m/s",
       "Maximum difference between the vehicle's speed and the plan's");
  read(limits.motion_distance_max_m, "motion_distance_max_m", 10.0, "m",
       "Maximum distance between a point and the position that the speed implies");
  read(limits.motion_distance_max_share, "motion_distance_max_share", 1.0, "1",
       "Additional distance, as a share of the distance between the points");
  read(limits.motion_heading_max_rad, "motion_heading_max_rad", 3.2, "rad",
       "Maximum difference between a heading and the one that the curvature implies");
  read(limits.motion_acceleration_max_mps2, "motion_acceleration_max_mps2", 50.0, "m/s^2",
       "Between an acceleration and how speeds change");
  read(limits.motion_later_factor, "motion_later_factor", 100.0, "1",
       "Factor on the motion limits after certain_s and in the minimal-risk trajectory");
  read(limits.horizon_min_s, "horizon_min_s", 60.0, "s",
       "Minimum horizon of a plan that does not end in standstill");
  read(limits.age_max_s, "age_max_s", 10.0, "s", "Maximum age of the plan and of predictions");
  read(limits.certain_s, "certain_s", 60.0, "s",
       "Violations after this time are only noted, as newer plans replace this one by then");
  read(limits.over_edge_max_m, "over_edge_max_m", 100.0, "m",
       "Maximum distance of the body outside all lanes");
  read(limits.over_edge_noted_m, "over_edge_noted_m", 100.0, "m",
       "Distance outside all lanes from which it is noted");
  read(limits.gap_min_m, "gap_min_m", 10.0, "m", "Minimum gap to predicted objects");
  read(limits.gap_noted_m, "gap_noted_m", 10.0, "m",
       "Gap to predicted objects below which it is noted");
  read(limits.speed_limit_excess_max_mps, "speed_limit_excess_max_mps", 100.0, "m/s",
       "Maximum excess over the map's limit, or over the initial speed");
  read(limits.speed_limit_excess_noted_mps, "speed_limit_excess_noted_mps", 100.0, "m/s",
       "Excess over the map's limit from which it is noted");
  read(limits.later_s, "later_s", 10.0, "s",
       "If what control follows without the plan touches nothing, or so much later");
  read(limits.collision_certain_s, "collision_certain_s", 60.0, "s",
       "A plan with a collision within this time is rejected");
  return limits;
}

// "COLLISION" as "collision".
std::string name_of(planning::Rule rule) {
  std::string name = planning::Rule_Name(rule);
  std::ranges::transform(name, name.begin(), [](unsigned char letter) {
    return static_cast<char>(std::tolower(letter));
  });
  return name;
}

}  // namespace

PlanChecker::PlanChecker(fastcycle::Context& context)
    : Component(context),
      limits_(read_limits(context)),
      rules_(limits_),
      predictions_(context.create_latest<prediction::Predictions>("prediction/objects")),
      egos_(context.create_latest<localization::Ego>("localization/ego")),
      tiles_(context.create_latest<hd_map::Tile>("map/tile")),
      checked_plans_(context.create_publisher<planning::Plan>("planning/checked_plan")),
      verdicts_(context.create_publisher<planning::PlanVerdict>("planning/verdict")),
      state_(context.state<planning::PlanCheckerState>("plan_checker",
                                                       [this](auto& state) { save(state); })) {
  load(*state_);
  context.create_subscriber<planning::Plan>(
      "planning/plan", [this](const fastcycle::Sample<planning::Plan>& plan) { on_plan(plan); });
}

void PlanChecker::save(planning::PlanCheckerState& state) const {
  if (plans_ == 0) {
    return;
  }
  *state.mutable_accepted() = accepted_;
  state.set_rejected_in_a_row(rejected_in_a_row_);
  state.set_plans(plans_);
  state.set_plans_rejected(plans_rejected_);
  state.set_plans_noted(plans_noted_);
}

void PlanChecker::load(const planning::PlanCheckerState& state) {
  accepted_ = state.accepted();
  rejected_in_a_row_ = state.rejected_in_a_row();
  plans_ = state.plans();
  plans_rejected_ = state.plans_rejected();
  plans_noted_ = state.plans_noted();
}

void PlanChecker::stop() {
  report("plans", plans_);
  report("plans_rejected", plans_rejected_);
  report("plans_noted", plans_noted_);
  for (const auto& [name, number] : breaches_) {
    report(name, number);
  }
}

void PlanChecker::update_road() {
  const auto tile = tiles_.get();
  if (tile && (!road_ || tile.info().sequence != tile_sequence_)) {
    tile_sequence_ = tile.info().sequence;
    road_.emplace(*tile);
  }
}

// The newest estimate, moved on to now along an arc. None while there is no position, or not a
// finite one.
std::optional<Motion> PlanChecker::ego_now() const {
  const auto ego = egos_.get();
  if (!ego || ego->quality() == localization::INITIALIZING) {
    return std::nullopt;
  }
  const double age_s = seconds_of(now().time_since_epoch().count() - ego->header().taken_ns());
  const double ahead_s = std::clamp(age_s, 0.0, kPlanChecker.oldest_s);
  const double way_m = ahead_s * (ego->speed_mps() + 0.5 * ahead_s * ego->acceleration_mps2());
  const double turn = ahead_s * ego->yaw_rate_radps();
  const Motion motion{.x_m = ego->x_m() + way_m * std::cos(ego->heading_rad() + 0.5 * turn),
                      .y_m = ego->y_m() + way_m * std::sin(ego->heading_rad() + 0.5 * turn),
                      .heading_rad = ego->heading_rad() + turn,
                      .speed_mps = ego->speed_mps() + ahead_s * ego->acceleration_mps2()};
  const bool is_finite =
      std::isfinite(motion.x_m + motion.y_m + motion.heading_rad + motion.speed_mps);
  return is_finite ? std::optional(motion) : std::nullopt;
}

void PlanChecker::on_plan(const fastcycle::Sample<planning::Plan>& plan) {
  update_road();
  const auto predictions = predictions_.get();
  const std::int64_t now_ns = now().time_since_epoch().count();
  const bool is_accepted_new =
      accepted_.has_nominal() &&
      seconds_of(now_ns - accepted_.nominal().start_ns()) < limits_.age_max_s;
  auto verdict = verdicts_.loan();
  rules_.check(*plan,
               {.now_ns = now_ns,
                .ego = ego_now(),
                .predictions = predictions ? &*predictions : nullptr,
                .road = road_ ? &*road_ : nullptr,
                .accepted = is_accepted_new ? &accepted_ : nullptr},
               *verdict);
  count(*verdict);
  verdict->set_rejected_in_a_row(rejected_in_a_row_);
  if (verdict->is_accepted()) {
    accepted_ = *plan;
    checked_plans_.publish(plan);
  }
  verdicts_.publish(std::move(verdict));
}

void PlanChecker::count(const planning::PlanVerdict& verdict) {
  ++plans_;
  for (const planning::RuleBreach& breach : verdict.breaches()) {
    ++breaches_[name_of(breach.rule()) + (breach.is_hard() ? "_rejected" : "_noted")];
  }
  if (verdict.is_accepted()) {
    rejected_in_a_row_ = 0;
    plans_noted_ += verdict.breaches().empty() ? 0 : 1;
    return;
  }
  ++plans_rejected_;
  ++rejected_in_a_row_;
  log().warning("the plan ({}) is rejected: {}", planning::PlanKind_Name(verdict.plan_kind()),
                verdict.reason());
}

}  // namespace plan_checker

FASTCYCLE_COMPONENT(plan_checker::PlanChecker)

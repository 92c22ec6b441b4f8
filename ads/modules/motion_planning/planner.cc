#include "planner.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "common/scalar.h"
#include "minimal_risk.h"
#include "motion_planning_tuning.h"

namespace motion_planning {
namespace {

using ads::kInfinity;
using ads::outside;

constexpr double kHalfStep_s = kStep_s / 2.0;
// Deviations from the goal state: all 0 when it is reached.
struct Miss {
  double along_m = 0.0;
  double across_m = 0.0;
  double heading_rad = 0.0;
  double speed_mps = 0.0;

  [[nodiscard]] double size() const {
    return std::abs(along_m) + std::abs(across_m) + 10.0 * std::abs(heading_rad) +
           std::abs(speed_mps);
  }
};

Miss miss_of(const Goal& goal, const Road& road, const State& state) {
  const double cosine = std::cos(goal.centre.heading_rad);
  const double sine = std::sin(goal.centre.heading_rad);
  const double dx = state.x_m - goal.centre.x_m;
  const double dy = state.y_m - goal.centre.y_m;
  double along = dx * cosine + dy * sine;
  double across = -dx * sine + dy * cosine;
  if (goal.on_road) {
    const RoadPlace place = road.locate(state.x_m, state.y_m);
    along = place.along_m - goal.on_road->middle_m();
    across = place.offset_m - goal.on_road->offset_m(place.along_m);
  }
  Miss miss{.along_m = outside(along, -goal.half_length_m, goal.half_length_m),
            .across_m = outside(across, -goal.half_width_m, goal.half_width_m),
            .speed_mps = outside(state.speed_mps, goal.speed_mps.low, goal.speed_mps.high)};
  const double middle = 0.5 * (goal.heading_rad.low + goal.heading_rad.high);
  if (std::isfinite(middle)) {
    const double half = goal.heading_rad.high - middle;
    miss.heading_rad = outside(wrapped(state.heading_rad - middle), -half, half);
  }
  return miss;
}

// The smallest deviation, and when the trajectory has it first.
std::pair<Miss, double> smallest_miss(const Goal& goal, const Road& road,
                                      const Trajectory& trajectory) {
  std::pair<Miss, double> best;
  double best_size = kInfinity;
  const double begin = std::max(goal.time_s.low, trajectory.start_s);
  for (double time = begin; time <= goal.time_s.high + 1e-9; time += kPlanner.look_s) {
    const Miss miss = miss_of(goal, road, trajectory.at(time));
    if (miss.size() < best_size) {
      best_size = miss.size();
      best = {miss, time};
    }
  }
  return best;
}

// When the trajectory reaches the goal, or what it misses it by at best.
void set_goal_miss(const Goal& goal, const Road& road, Plan& plan) {
  const auto [best, time_s] = smallest_miss(goal, road, plan.nominal);
  if (best.size() == 0.0) {
    plan.goal_s = time_s;
    return;
  }
  if (plan.reason.empty()) {
    plan.reason = fmt::format(
        "the goal is missed by {:.1f} m along, {:.1f} m across, {:.2f} rad and {:.1f} m/s",
        best.along_m, best.across_m, best.heading_rad, best.speed_mps);
  }
}

// The goal, with times since the plan's start; none when its time is over.
std::optional<Goal> goal_from(std::optional<Goal> goal, double start_s) {
  if (!goal || goal->time_s.high < start_s) {
    return std::nullopt;
  }
  goal->time_s.low -= start_s;
  goal->time_s.high -= start_s;
  return goal;
}

std::string name_of(const Situation& situation, std::size_t object) {
  return object < situation.objects.size() ? fmt::format("object {}", situation.objects[object].id)
                                           : std::string("a closed place");
}

// The states that are driven before the trajectory's own.
void prepend(const std::vector<State>& states, Trajectory& trajectory) {
  trajectory.states.insert(trajectory.states.begin(), states.begin(), states.end() - 1);
  trajectory.start_s -= trajectory.step_s * static_cast<double>(states.size() - 1);
}

// The objects, with times since `after_s`. A place that must not be driven over is as good as a
// thing that stands there.
std::vector<TrafficObject> objects_from(const Situation& situation, double after_s) {
  std::vector<TrafficObject> objects = situation.objects;
  for (TrafficObject& object : objects) {
    for (PredictedWay& way : object.ways) {
      way.first_s -= after_s;
    }
  }
  for (const HazardArea& hazard : situation.hazards) {
    if (hazard.speed_mps <= 0.0) {
      const double heading = situation.road->locate(hazard.x_m, hazard.y_m).heading_rad;
      const PredictedState state{.x_m = hazard.x_m, .y_m = hazard.y_m, .heading_rad = heading};
      objects.push_back({.length_m = 2.0 * hazard.radius_m,
                         .width_m = 2.0 * hazard.radius_m,
                         .ways = {{.states = {state}}}});
    }
  }
  return objects;
}

std::vector<SlowStretch> slow_stretches(const Situation& situation) {
  std::vector<SlowStretch> stretches;
  for (const HazardArea& hazard : situation.hazards) {
    if (hazard.speed_mps > 0.0) {
      const double along = situation.road->locate(hazard.x_m, hazard.y_m).along_m;
      stretches.push_back({.begin_m = along - hazard.radius_m,
                           .end_m = along + hazard.radius_m,
                           .speed_mps = hazard.speed_mps});
    }
  }
  return stretches;
}

// A rule binds from where the trajectory comes within the profile's tolerance of it.
std::vector<BindingRule> binding_rules(const Problem& problem, const Trajectory& trajectory) {
  const SpeedProfile profile = profile_of(problem);
  std::vector<BindingRule> binding;
  const State& first = trajectory.states.front();
  RoadPlace place = problem.road.locate(first.x_m, first.y_m);
  const double from_m = place.along_m;
  for (std::size_t index = 0; index < trajectory.states.size(); ++index) {
    const State& state = trajectory.states[index];
    place = problem.road.locate_near(state.x_m, state.y_m, place.index);
    const std::optional<Rule> rule = profile.binding(place.along_m, state.speed_mps);
    const auto is_same = [&](const BindingRule& other) { return other.rule == *rule; };
    if (rule && std::ranges::none_of(binding, is_same)) {
      binding.push_back({.rule = *rule,
                         .place = problem.road.pose(rule->along_m, 0.0),
                         .ahead_m = rule->along_m - from_m,
                         .time_s = trajectory.step_s * static_cast<double>(index)});
    }
  }
  return binding;
}

Trajectory start_of(const Problem& problem) {
  return {.start_s = 0.0, .step_s = kHalfStep_s, .states = {problem.start}};
}

// A collision that cannot be avoided is to be late, as predictions may be wrong, and slow.
double harm(const Verdict& verdict) {
  return std::isfinite(verdict.hit_s)
             ? (1.0 + verdict.hit_mps / kPlanner.slow_mps) / (kPlanner.soon_s + verdict.hit_s)
             : 0.0;
}

// By how much more than at its start the vehicle is over the road's edge.
double road_left_by_m(const PlannerConfig& config, const Problem& problem,
                      const Trajectory& trajectory) {
  return over_edge_m(config.vehicle, trajectory, problem.road, config.certain_s) -
         over_edge_m(config.vehicle, start_of(problem), problem.road, config.certain_s);
}

// Whether it may be driven without being an evasion.
bool is_nominal(const PlannerConfig& config, const Problem& problem, const Trajectory& trajectory) {
  const Verdict verdict = judge(config.vehicle, trajectory, problem.traffic, config.certain_s);
  return !std::isfinite(verdict.hit_s) &&
         verdict.acceleration_min_mps2 >= -kPlanner.hard_braking_mps2 &&
         verdict.lateral_max_mps2 <= kPlanner.hard_turning_mps2 &&
         road_left_by_m(config, problem, trajectory) <= kPlanner.over_edge_m;
}

// Positions that brake as hard as can be, and move to the side by `side_m`.
std::vector<Pose> braking_guess(const Problem& problem, double side_m) {
  const RoadPlace start = problem.road.locate(problem.start.x_m, problem.start.y_m);
  const double speed = std::max(0.0, problem.start.speed_mps);
  std::vector<Pose> guess;
  for (std::size_t step = 1; step <= problem.traffic.steps(); ++step) {
    const double time = kStep_s * static_cast<double>(step);
    const double braked = std::min(time, speed / kPlanner.braking_mps2);
    const double along = speed * braked - 0.5 * kPlanner.braking_mps2 * braked * braked;
    const double side = side_m * std::min(1.0, braked / kPlanner.aside_s);
    guess.push_back(problem.road.pose(start.along_m + along, start.offset_m + side));
  }
  return guess;
}

}  // namespace

Planner::Memory Planner::memory() const {
  return {.last = last_,
          .last_s = last_s_,
          .last_trajectory = last_trajectory_,
          .begun_mps = begun_mps_,
          .stood_at_lane = stood_at_lane_};
}

void Planner::set_memory(Memory memory) {
  last_ = std::move(memory.last);
  last_s_ = memory.last_s;
  last_trajectory_ = std::move(memory.last_trajectory);
  begun_mps_ = memory.begun_mps;
  stood_at_lane_ = memory.stood_at_lane;
}

// The states driven before the new plan can take effect: those of the last plan, if the vehicle
// follows it, else the present motion. The last state is the new plan's start.
std::vector<State> Planner::committed(const Situation& situation) const {
  const State& ego = situation.ego;
  const Trajectory& last = last_trajectory_;
  bool is_followed = last_ && situation.is_driving &&
                     situation.now_s + config_.committed_s < last.start_s + last.duration_s();
  if (is_followed) {
    const State planned = last.at(situation.now_s);
    is_followed = std::hypot(planned.x_m - ego.x_m, planned.y_m - ego.y_m) < kPlanner.off_plan_m &&
                  std::abs(planned.speed_mps - ego.speed_mps) < kPlanner.off_plan_mps &&
                  std::abs(wrapped(planned.heading_rad - ego.heading_rad)) < kPlanner.off_plan_rad;
  }
  std::vector<State> states = {is_followed ? last.at(situation.now_s) : ego};
  const auto count = static_cast<std::size_t>(std::llround(config_.committed_s / kHalfStep_s));
  for (std::size_t index = 1; index <= count; ++index) {
    const double time = kHalfStep_s * static_cast<double>(index);
    states.push_back(is_followed ? last.at(situation.now_s + time)
                                 : drive(config_.vehicle, states.back(), Input{}, kHalfStep_s));
    states.back().speed_mps = std::max(0.0, states.back().speed_mps);
  }
  return states;
}

// Where the vehicle will be, as far as that is known before there is a plan.
std::vector<State> Planner::expected(const State& start, double start_s, bool is_driving,
                                     std::size_t steps) const {
  std::vector<State> states = {start};
  for (std::size_t step = 1; step <= steps; ++step) {
    const double time = kStep_s * static_cast<double>(step);
    State straight = start;
    straight.x_m += time * start.speed_mps * std::cos(start.heading_rad);
    straight.y_m += time * start.speed_mps * std::sin(start.heading_rad);
    states.push_back(last_ && is_driving ? last_trajectory_.at(start_s + time) : straight);
  }
  return states;
}

Way Planner::continued(const Problem& problem, double start_s) const {
  Way way{.states = {problem.start}, .inputs = {}};
  const double shift = (start_s - last_s_) / kStep_s;
  const auto input_at = [this](std::size_t step) {
    return step < last_->inputs.size() ? last_->inputs[step] : Input{};
  };
  for (std::size_t step = 0; step < problem.traffic.steps(); ++step) {
    const double place = shift + static_cast<double>(step);
    const auto index = static_cast<std::size_t>(place);
    const double share = place - static_cast<double>(index);
    const Input from = input_at(index);
    const Input to = input_at(index + 1);
    way.inputs.push_back({.jerk_mps3 = std::lerp(from.jerk_mps3, to.jerk_mps3, share),
                          .steering_rate_radps =
                              std::lerp(from.steering_rate_radps, to.steering_rate_radps, share)});
  }
  return way;
}

// Without a limit: as is usual in towns, or faster, as the driver was or those around him are.
double Planner::cruise_mps(const Situation& situation) const {
  const Road& road = *situation.road;
  const double along = road.locate(situation.ego.x_m, situation.ego.y_m).along_m;
  double sum = 0.0;
  double count = 0.0;
  for (const TrafficObject& object : situation.objects) {
    if (object.ways.empty() || object.ways.front().states.empty()) {
      continue;
    }
    const PredictedState& state = object.ways.front().states.front();
    const RoadPlace place = road.locate(state.x_m, state.y_m);
    const bool is_on_road = place.offset_m < road.left_edge_m(place.along_m) &&
                            -place.offset_m < road.right_edge_m(place.along_m);
    if (state.speed_mps > kPlanner.moving_mps &&
        std::abs(place.along_m - along) < kPlanner.around_m && is_on_road &&
        std::cos(state.heading_rad - place.heading_rad) > kPlanner.aligned) {
      sum += state.speed_mps;
      count += 1.0;
    }
  }
  const double flow = count > 0.0 ? sum / count : 0.0;
  return std::max({config_.cruise_mps, begun_mps_.value_or(0.0), flow});
}

Way Planner::best_way(const Problem& problem, double start_s, bool is_driving, Plan& plan) const {
  Optimizer optimizer(problem);
  const Found found = Search(problem, config_.beam).run();
  plan.candidates = found.candidates;
  plan.feasible = found.feasible;
  Way best = optimizer.improve(optimizer.follow(found.poses));
  if (last_ && is_driving) {
    Way same = optimizer.improve(continued(problem, start_s));
    // The last plan is continued, unless another way is clearly better.
    if (same.cost <= kPlanner.same_share * best.cost + kPlanner.same_cost) {
      best = std::move(same);
    }
  }
  return best;
}

// Whether the last plan pulls out, and may go on with it: a vehicle that stops again each time that
// predictions change blocks the way of others.
bool Planner::pulls_out(const Problem& problem, double start_s) const {
  if (!last_ ||
      last_trajectory_.at(start_s + kPlanner.pulled_out_s).speed_mps < kPlanner.moving_mps) {
    return false;
  }
  const Trajectory same = trajectory_of(config_.vehicle, continued(problem, start_s), start_s);
  return judge(config_.vehicle, same, problem.traffic, config_.certain_s).smallest_gap_m >
         kPlanner.pulling_out_gap_m;
}

// The way, or one near it that stays on the road where only that is wrong with it.
Way Planner::kept_on_road(const Problem& problem, Way way) const {
  const Trajectory trajectory = trajectory_of(config_.vehicle, way, 0.0);
  if (road_left_by_m(config_, problem, trajectory) <= kPlanner.over_edge_m) {
    return way;
  }
  Problem narrow = problem;
  narrow.edge_share = kPlanner.narrow_edge_share;
  Way nearer = Optimizer(narrow).improve(way);
  return is_nominal(config_, problem, trajectory_of(config_.vehicle, nearer, 0.0)) ? nearer : way;
}

// The way, or one near it that reaches the goal where it narrowly misses that: a goal is a place to
// be in, and costs of comfort can outweigh a small deviation from it.
Way Planner::finished(const Problem& problem, const Goal& goal, Way way, double start_s) const {
  const auto missed = [&](const Trajectory& trajectory) {
    return smallest_miss(goal, problem.road, trajectory).first.size();
  };
  const Trajectory trajectory = trajectory_of(config_.vehicle, way, start_s);
  const double missed_by = missed(trajectory);
  if (missed_by == 0.0 || missed_by > kPlanner.narrow_miss ||
      !is_nominal(config_, problem, trajectory)) {
    return way;
  }
  Problem urgent = problem;
  urgent.goal_share = kPlanner.urgent_goal_share;
  Way nearer = Optimizer(urgent).improve(way);
  const Trajectory other = trajectory_of(config_.vehicle, nearer, start_s);
  return missed(other) == 0.0 && is_nominal(config_, problem, other) ? nearer : way;
}

Way Planner::evade(const Problem& problem, const Way& nominal) const {
  Problem emergency = problem;
  emergency.is_emergency = true;
  Optimizer optimizer(emergency);
  std::vector<Way> ways = {optimizer.improve(nominal)};
  for (const double side : {0.0, kPlanner.aside_m, -kPlanner.aside_m}) {
    ways.push_back(optimizer.improve(optimizer.follow(braking_guess(problem, side))));
  }
  // To stand where the vehicle is, whatever its goal.
  ways.push_back(optimizer.follow(braking_guess(problem, 0.0)));
  ways.back().cost = optimizer.cost(ways.back());
  // The area beside the road is unknown: only if every way leads over its edge, the one that does
  // so by least is chosen.
  const double allowed_m = kPlanner.over_edge_m + over_edge_m(config_.vehicle, start_of(problem),
                                                              problem.road, config_.certain_s);
  const auto price = [&](const Way& way) {
    const Trajectory trajectory = trajectory_of(config_.vehicle, way, 0.0);
    const Verdict verdict = judge(config_.vehicle, trajectory, problem.traffic, config_.certain_s);
    const double over =
        over_edge_m(config_.vehicle, trajectory, problem.road, config_.certain_s) - allowed_m;
    return std::tuple(std::max(0.0, over), harm(verdict), way.cost);
  };
  std::size_t best = 0;
  auto least = price(ways.front());
  for (std::size_t index = 1; index < ways.size(); ++index) {
    const auto other = price(ways[index]);
    if (other < least) {
      least = other;
      best = index;
    }
  }
  return ways[best];
}

void Planner::add_minimal_risk(const Problem& problem, const Traffic& unyielding,
                               Plan& plan) const {
  Stop stop = safest_stop(problem, unyielding, plan.nominal);
  if (stop.hit_s <= stop.trajectory.duration_s()) {
    // In no lane, then: wherever there is room to stop.
    Problem stopping = problem;
    stopping.goal.reset();
    stopping.cruise_within_mps = {.low = 0.0, .high = 0.0};
    stopping.is_emergency = true;
    Optimizer optimizer(stopping);
    const Way aside = optimizer.improve(optimizer.follow(braking_guess(problem, 0.0)));
    Stop other = stop_along(problem, unyielding,
                            trajectory_of(config_.vehicle, aside, plan.nominal.start_s));
    if (other.hit_s > stop.hit_s) {
      stop = std::move(other);
    }
  }
  plan.minimal_risk = std::move(stop.trajectory);
}

Plan Planner::plan(const Situation& situation) {
  const std::vector<State> committed_states = committed(situation);
  const double start_s = situation.now_s + config_.committed_s;
  std::optional<Goal> goal = goal_from(situation.goal, start_s);
  double horizon = config_.horizon_min_s;
  if (goal && goal->on_road) {
    // A vehicle that is farther already may stay there.
    const State& start = committed_states.back();
    const double ahead = situation.road->locate(start.x_m, start.y_m).along_m -
                         goal->on_road->middle_m() - goal->room_along_m();
    goal->spare_share = ahead > 0.0 ? 0.0 : goal->spare_share;
  }
  if (goal) {
    horizon = std::clamp(goal->time_s.high + kPlanner.after_goal_s, horizon, config_.horizon_max_s);
  }
  const auto steps = 2 * static_cast<std::size_t>(std::ceil(horizon / (2.0 * kStep_s)));
  const std::vector<State> expected_states =
      expected(committed_states.back(), start_s, situation.is_driving, steps);
  const std::vector<TrafficObject> objects = objects_from(situation, config_.committed_s);
  const Traffic unyielding(objects, steps);
  const Traffic traffic(
      in_queues(objects, *situation.road, config_.vehicle, expected_states, horizon), steps);
  Problem problem{.vehicle = config_.vehicle,
                  .road = *situation.road,
                  .traffic = traffic,
                  .start = committed_states.back(),
                  .lanes = situation.lanes,
                  .goal = goal,
                  .slow_stretches = slow_stretches(situation)};
  if (!situation.is_driving || !begun_mps_) {
    begun_mps_ = std::max(0.0, situation.ego.speed_mps);
  }
  problem.cruise_mps = cruise_mps(situation);
  if (situation.goal &&
      std::isfinite(situation.goal->speed_mps.low + situation.goal->speed_mps.high)) {
    // After the goal as at the goal.
    const double speed =
        std::max(0.0, 0.5 * (situation.goal->speed_mps.low + situation.goal->speed_mps.high));
    problem.cruise_within_mps = {.low = speed, .high = speed};
  }
  stood_at_lane_ = stood_at(*situation.road, config_.vehicle, situation.ego,
                            situation.waiting_lines, stood_at_lane_);
  problem.halt = halt_before(problem, unyielding, objects, situation.waiting_lines, stood_at_lane_);
  if (problem.halt && problem.halt->is_here && situation.is_driving &&
      pulls_out(problem, start_s)) {
    problem.halt.reset();
  }
  if (!situation.goal && !problem.halt && situation.map_end_m) {
    problem.halt = halt_before_end(problem, *situation.map_end_m);
  }

  Plan plan;
  plan.kind = PlanKind::kNominal;
  Way way = best_way(problem, start_s, situation.is_driving, plan);
  way = kept_on_road(problem, std::move(way));
  if (goal) {
    way = finished(problem, *situation.goal, std::move(way), start_s);
  }
  plan.nominal = trajectory_of(config_.vehicle, way, start_s);
  Verdict verdict = judge(config_.vehicle, plan.nominal, traffic, config_.certain_s);
  // To leave the road is as bad as to touch something.
  const double left_m = road_left_by_m(config_, problem, plan.nominal);
  if (std::isfinite(verdict.hit_s) || left_m > kPlanner.over_edge_m) {
    plan.kind = PlanKind::kEvasive;
    plan.reason = std::isfinite(verdict.hit_s)
                      ? fmt::format("{} would be touched in {:.1f} s",
                                    name_of(situation, verdict.object), verdict.hit_s)
                      : fmt::format("the road would be left by {:.1f} m", left_m);
    way = evade(problem, way);
    plan.nominal = trajectory_of(config_.vehicle, way, start_s);
    verdict = judge(config_.vehicle, plan.nominal, traffic, config_.certain_s);
  }
  add_minimal_risk(problem, unyielding, plan);
  if (std::isfinite(verdict.hit_s)) {
    const Verdict stopping = judge(config_.vehicle, plan.minimal_risk, traffic, config_.certain_s);
    const auto over = [&](const Trajectory& trajectory) {
      return over_edge_m(config_.vehicle, trajectory, problem.road, config_.certain_s);
    };
    if (stopping.hit_s > verdict.hit_s &&
        over(plan.minimal_risk) <= kPlanner.over_edge_m + over(plan.nominal)) {
      plan.kind = PlanKind::kNone;
      plan.nominal = plan.minimal_risk;
    }
  }
  plan.smallest_gap_m =
      judge(config_.vehicle, plan.nominal, traffic, plan.nominal.duration_s()).smallest_gap_m;
  prepend(committed_states, plan.nominal);
  prepend(committed_states, plan.minimal_risk);
  plan.binding_rules = binding_rules(problem, plan.nominal);
  if (situation.goal) {
    set_goal_miss(*situation.goal, *situation.road, plan);
  }
  last_ = std::move(way);
  last_s_ = start_s;
  last_trajectory_ = plan.nominal;
  return plan;
}

}  // namespace motion_planning

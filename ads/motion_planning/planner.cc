#include "planner.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "minimal_risk.h"

namespace motion_planning {
namespace {

constexpr double kStep_s = Traffic::kStep_s;
constexpr double kHalfStep_s = kStep_s / 2.0;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Planned on after the goal, so that the vehicle does not come to it in a way that ends there.
constexpr double kAfterGoal_s = 2.0;
// Farther than this from the plan the vehicle does not follow it.
constexpr double kOffPlan_m = 1.0;
constexpr double kOffPlan_mps = 1.5;
constexpr double kOffPlan_rad = 0.2;

// What is missing to the goal state: 0 in all of them when it is reached.
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

double outside(double value, double low, double high) {
  return value < low ? value - low : std::max(0.0, value - high);
}

Miss miss_of(const Goal& goal, const State& state) {
  const double cosine = std::cos(goal.centre.heading_rad);
  const double sine = std::sin(goal.centre.heading_rad);
  const double dx = state.x_m - goal.centre.x_m;
  const double dy = state.y_m - goal.centre.y_m;
  Miss miss{.along_m = outside(dx * cosine + dy * sine, -goal.half_length_m, goal.half_length_m),
            .across_m = outside(-dx * sine + dy * cosine, -goal.half_width_m, goal.half_width_m),
            .speed_mps = outside(state.speed_mps, goal.speed_mps.low, goal.speed_mps.high)};
  const double middle = 0.5 * (goal.heading_rad.low + goal.heading_rad.high);
  if (std::isfinite(middle)) {
    const double half = goal.heading_rad.high - middle;
    miss.heading_rad = outside(wrapped(state.heading_rad - middle), -half, half);
  }
  return miss;
}

// When the trajectory reaches the goal, or what it misses it by at best.
void tell_of_goal(const Goal& goal, Plan& plan) {
  constexpr double kLook_s = 0.02;
  Miss best;
  double best_size = kInfinity;
  const double begin = std::max(goal.time_s.low, plan.nominal.start_s);
  for (double time = begin; time <= goal.time_s.high + 1e-9; time += kLook_s) {
    const Miss miss = miss_of(goal, plan.nominal.at(time));
    if (miss.size() == 0.0) {
      plan.goal_s = time;
      return;
    }
    if (miss.size() < best_size) {
      best_size = miss.size();
      best = miss;
    }
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
      stretches.push_back({.along_m = {along - hazard.radius_m, along + hazard.radius_m},
                           .speed_mps = hazard.speed_mps});
    }
  }
  return stretches;
}

// Positions that brake as hard as can be, and move to the side by `side_m`.
std::vector<Pose> braking_guess(const Problem& problem, double side_m) {
  constexpr double kBraking_mps2 = 7.5;
  constexpr double kAside_s = 1.5;
  const RoadPlace start = problem.road.locate(problem.start.x_m, problem.start.y_m);
  const double speed = std::max(0.0, problem.start.speed_mps);
  std::vector<Pose> guess;
  for (std::size_t step = 1; step <= problem.traffic.steps(); ++step) {
    const double time = kStep_s * static_cast<double>(step);
    const double braked = std::min(time, speed / kBraking_mps2);
    const double along = speed * braked - 0.5 * kBraking_mps2 * braked * braked;
    const double side = side_m * std::min(1.0, braked / kAside_s);
    guess.push_back(problem.road.pose(start.along_m + along, start.offset_m + side));
  }
  return guess;
}

}  // namespace

// What will be driven before the new plan can show: the last one, if the vehicle follows it, else
// the present motion. The last state is where the new plan starts.
std::vector<State> Planner::committed(const Situation& situation) const {
  const State& ego = situation.ego;
  const Trajectory& last = last_trajectory_;
  bool is_followed = last_ && situation.is_driving &&
                     situation.now_s + config_.committed_s < last.start_s + last.duration_s();
  if (is_followed) {
    const State planned = last.at(situation.now_s);
    is_followed = std::hypot(planned.x_m - ego.x_m, planned.y_m - ego.y_m) < kOffPlan_m &&
                  std::abs(planned.speed_mps - ego.speed_mps) < kOffPlan_mps &&
                  std::abs(wrapped(planned.heading_rad - ego.heading_rad)) < kOffPlan_rad;
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

Way Planner::best_way(const Problem& problem, double start_s, bool is_driving, Plan& plan) const {
  Optimizer optimizer(problem);
  const Found found = Search(problem, config_.beam).run();
  plan.candidates = found.candidates;
  plan.feasible = found.feasible;
  Way best = optimizer.improve(optimizer.follow(found.poses));
  if (last_ && is_driving) {
    Way same = optimizer.improve(continued(problem, start_s));
    // What was begun is gone on with, unless another way is clearly better.
    if (same.cost <= 1.02 * best.cost + 0.1) {
      best = std::move(same);
    }
  }
  return best;
}

Way Planner::evade(const Problem& problem, const Way& nominal) const {
  constexpr double kAside_m = 1.2;
  Problem emergency = problem;
  emergency.is_emergency = true;
  Optimizer optimizer(emergency);
  std::vector<Way> ways = {optimizer.improve(nominal)};
  for (const double side : {0.0, kAside_m, -kAside_m}) {
    ways.push_back(optimizer.improve(optimizer.follow(braking_guess(problem, side))));
  }
  const auto price = [&](const Way& way) {
    const Trajectory trajectory = trajectory_of(config_.vehicle, way, 0.0);
    const double hit = judge(config_.vehicle, trajectory, problem.traffic, config_.certain_s).hit_s;
    return std::pair(-std::min(hit, config_.certain_s), way.cost);
  };
  return *std::min_element(ways.begin(), ways.end(), [&](const Way& one, const Way& other) {
    return price(one) < price(other);
  });
}

void Planner::add_minimal_risk(const Problem& problem, const Traffic& unyielding,
                               Plan& plan) const {
  Stop stop = safest_stop(problem, unyielding, plan.nominal);
  if (stop.hit_s <= stop.trajectory.duration_s()) {
    // In no lane, then: wherever there is room to stop.
    Problem stopping = problem;
    stopping.goal.reset();
    stopping.cruise_mps = 0.0;
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
  const std::optional<Goal> goal = goal_from(situation.goal, start_s);
  double horizon = config_.horizon_min_s;
  if (goal) {
    horizon = std::clamp(goal->time_s.high + kAfterGoal_s, horizon, config_.horizon_max_s);
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
  if (situation.goal &&
      std::isfinite(situation.goal->speed_mps.low + situation.goal->speed_mps.high)) {
    problem.cruise_mps =
        std::max(0.0, 0.5 * (situation.goal->speed_mps.low + situation.goal->speed_mps.high));
  }

  Plan plan;
  plan.kind = PlanKind::kNominal;
  Way way = best_way(problem, start_s, situation.is_driving, plan);
  plan.nominal = trajectory_of(config_.vehicle, way, start_s);
  Verdict verdict = judge(config_.vehicle, plan.nominal, traffic, config_.certain_s);
  if (std::isfinite(verdict.hit_s)) {
    plan.kind = PlanKind::kEvasive;
    plan.reason = fmt::format("{} would be touched in {:.1f} s", name_of(situation, verdict.object),
                              verdict.hit_s);
    way = evade(problem, way);
    plan.nominal = trajectory_of(config_.vehicle, way, start_s);
    verdict = judge(config_.vehicle, plan.nominal, traffic, config_.certain_s);
  }
  add_minimal_risk(problem, unyielding, plan);
  if (std::isfinite(verdict.hit_s)) {
    const Verdict stopping = judge(config_.vehicle, plan.minimal_risk, traffic, config_.certain_s);
    if (stopping.hit_s > verdict.hit_s) {
      plan.kind = PlanKind::kNone;
      plan.nominal = plan.minimal_risk;
    }
  }
  plan.smallest_gap_m =
      judge(config_.vehicle, plan.nominal, traffic, plan.nominal.duration_s()).smallest_gap_m;
  prepend(committed_states, plan.nominal);
  prepend(committed_states, plan.minimal_risk);
  if (situation.goal) {
    tell_of_goal(*situation.goal, plan);
  }
  last_ = std::move(way);
  last_s_ = start_s;
  last_trajectory_ = plan.nominal;
  return plan;
}

}  // namespace motion_planning

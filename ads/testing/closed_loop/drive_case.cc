#include "drive_case.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <deque>
#include <map>
#include <optional>
#include <random>

#include "common/scalar.h"
#include "modules/control/tracker.h"

namespace motion_planning {
namespace {

using ads::outside;

constexpr double kScenarioStep_s = 0.1;

// The thread's own time: what other programs of the machine do is not counted.
double cpu_ms() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

std::vector<Eigen::Vector2d> centre_of(const ads::Lanelet& lanelet) {
  std::vector<Eigen::Vector2d> centre;
  for (std::size_t index = 0; index < lanelet.left_m.size(); ++index) {
    centre.push_back(0.5 * (lanelet.left_m[index] + lanelet.right_m[index]));
  }
  return centre;
}

// The lanelet at a place that leads in its direction best; 0 if there is none.
std::int64_t lanelet_at(const ads::Scenario& scenario, const Eigen::Vector2d& place,
                        double heading_rad) {
  std::int64_t best = 0;
  double smallest = 0.8;
  for (const auto& [id, lanelet] : scenario.lanelets) {
    if (!ads::contains(lanelet.polygon_m(), place)) {
      continue;
    }
    const ads::Polyline line(centre_of(lanelet));
    const double angle =
        std::abs(wrapped(line.heading_at(line.project(place).along_m) - heading_rad));
    if (angle < smallest) {
      smallest = angle;
      best = id;
    }
  }
  return best;
}

std::int64_t nearest_lanelet(const ads::Scenario& scenario, const Eigen::Vector2d& place,
                             double heading_rad) {
  if (const std::int64_t id = lanelet_at(scenario, place, heading_rad)) {
    return id;
  }
  std::int64_t best = 0;
  double smallest = 1e9;
  for (const auto& [id, lanelet] : scenario.lanelets) {
    const ads::Polyline line(centre_of(lanelet));
    const auto projection = line.project(place);
    if (std::abs(wrapped(line.heading_at(projection.along_m) - heading_rad)) > 0.8) {
      continue;
    }
    const double beyond =
        std::max({0.0, -projection.along_m, projection.along_m - line.length_m()});
    const double distance = std::abs(projection.offset_m) + beyond;
    if (distance < smallest) {
      smallest = distance;
      best = id;
    }
  }
  return best;
}

const ads::ScenarioState* state_at(const ads::Obstacle& obstacle, std::int64_t step) {
  if (obstacle.is_static) {
    return obstacle.states.data();
  }
  const std::int64_t index = step - obstacle.states.front().step;
  if (index < 0 || index >= static_cast<std::int64_t>(obstacle.states.size())) {
    return nullptr;
  }
  return &obstacle.states[static_cast<std::size_t>(index)];
}

ads::Box box_of(const ads::Obstacle& obstacle, const ads::ScenarioState& state) {
  return {.center_m = state.position_m,
          .heading_rad = state.heading_rad,
          .length_m = obstacle.length_m,
          .width_m = obstacle.width_m};
}

ads::Box box_of(const Vehicle& vehicle, const State& state) {
  return {.center_m = {state.x_m, state.y_m},
          .heading_rad = state.heading_rad,
          .length_m = vehicle.length_m,
          .width_m = vehicle.width_m};
}

PredictedState predicted(const ads::ScenarioState& state) {
  return {.x_m = state.position_m.x(),
          .y_m = state.position_m.y(),
          .heading_rad = state.heading_rad,
          .speed_mps = state.speed_mps};
}

constexpr double kPrediction_s = 8.0;
constexpr double kPredictionStep_s = 0.2;

void add_uncertainty(PredictedState& state, double time_s) {
  state.along_stddev_m = 0.15 + 0.5 * 0.8 * time_s * time_s;
  state.across_stddev_m = std::min(0.8, 0.1 + 0.12 * time_s);
}

// Along the lane at constant speed and offset, one way for each branch.
std::vector<PredictedWay> lane_following(const ads::Scenario& scenario,
                                         const ads::ScenarioState& now, double first_s) {
  std::vector<std::vector<std::int64_t>> chains;
  const double reach = std::max(0.0, now.speed_mps) * kPrediction_s + 5.0;
  const std::int64_t start = lanelet_at(scenario, now.position_m, now.heading_rad);
  std::deque<std::pair<std::vector<std::int64_t>, double>> open;
  if (start != 0) {
    const ads::Polyline line(centre_of(scenario.lanelets.at(start)));
    open.push_back({{start}, line.length_m() - line.project(now.position_m).along_m});
  }
  while (!open.empty() && chains.size() + open.size() < 12) {
    auto [chain, length] = open.front();
    open.pop_front();
    const auto& next = scenario.lanelets.at(chain.back()).successors;
    if (length > reach || next.empty()) {
      chains.push_back(chain);
      continue;
    }
    for (const std::int64_t id : next) {
      auto longer = chain;
      longer.push_back(id);
      open.push_back(
          {longer, length + ads::Polyline(centre_of(scenario.lanelets.at(id))).length_m()});
    }
  }
  for (auto& [chain, length] : open) {
    chains.push_back(chain);
  }
  std::vector<PredictedWay> ways;
  const auto count = static_cast<std::size_t>(kPrediction_s / kPredictionStep_s) + 1;
  for (const auto& chain : chains) {
    std::vector<Eigen::Vector2d> points;
    for (const std::int64_t id : chain) {
      for (const Eigen::Vector2d& point : centre_of(scenario.lanelets.at(id))) {
        points.push_back(point);
      }
    }
    const ads::Polyline line(points);
    const auto place = line.project(now.position_m);
    const double turn = wrapped(now.heading_rad - line.heading_at(place.along_m));
    PredictedWay way{.probability = 1.0 / static_cast<double>(chains.size()),
                     .first_s = first_s,
                     .step_s = kPredictionStep_s};
    for (std::size_t index = 0; index < count; ++index) {
      const double time = kPredictionStep_s * static_cast<double>(index);
      const double along = place.along_m + now.speed_mps * time;
      // Its lateral motion fades out.
      const double side =
          place.offset_m + now.speed_mps * std::sin(turn) * 1.0 * (1.0 - std::exp(-time / 1.0));
      const Eigen::Vector2d point = line.point_at(along, side);
      PredictedState state{.x_m = point.x(),
                           .y_m = point.y(),
                           .heading_rad = line.heading_at(along) + turn * std::exp(-time),
                           .speed_mps = now.speed_mps};
      add_uncertainty(state, time);
      way.states.push_back(state);
    }
    ways.push_back(way);
  }
  if (ways.empty()) {
    PredictedWay way{.probability = 1.0, .first_s = first_s, .step_s = kPredictionStep_s};
    for (std::size_t index = 0; index < count; ++index) {
      const double time = kPredictionStep_s * static_cast<double>(index);
      PredictedState state = predicted(now);
      state.x_m += time * now.speed_mps * std::cos(now.heading_rad);
      state.y_m += time * now.speed_mps * std::sin(now.heading_rad);
      add_uncertainty(state, time);
      way.states.push_back(state);
    }
    ways.push_back(way);
  }
  return ways;
}

// Errors that sensors leave, drawn alike in each run.
class Errors {
 public:
  Errors(double size, std::uint64_t seed) : size_(size), random_(seed) {}

  double draw(double stddev) {
    double sum = -6.0;
    for (int count = 0; count < 12; ++count) {
      sum += static_cast<double>(random_() >> 11U) * 0x1p-53;
    }
    return size_ * stddev * sum;
  }
  // An error that lasts: a first-order Gauss-Markov process, one for each key, stepped by each
  // call.
  double wander(std::uint64_t key, double stddev, double time_s, double step_s) {
    const double keep = std::exp(-step_s / time_s);
    const auto [entry, is_new] = wanders_.try_emplace(key, 0.0);
    entry->second =
        is_new ? draw(stddev) : keep * entry->second + draw(stddev * std::sqrt(1.0 - keep * keep));
    return entry->second;
  }
  [[nodiscard]] double size() const { return size_; }

 private:
  const double size_;
  std::mt19937_64 random_;
  std::map<std::uint64_t, double> wanders_;
};

ads::ScenarioState perceived(const ads::Obstacle& obstacle, ads::ScenarioState state,
                             Errors& errors) {
  if (errors.size() > 0.0) {
    const auto key = static_cast<std::uint64_t>(obstacle.id) * 8;
    const Eigen::Vector2d ahead = ads::direction(state.heading_rad);
    state.position_m +=
        (errors.draw(0.05) + errors.wander(key, 0.15, 1.0, kScenarioStep_s)) * ahead;
    state.position_m += (errors.draw(0.05) + errors.wander(key + 1, 0.1, 1.0, kScenarioStep_s)) *
                        ads::left_of(ahead);
    state.speed_mps =
        std::max(0.0, state.speed_mps + errors.wander(key + 2, 0.4, 0.4, kScenarioStep_s));
    state.heading_rad += errors.wander(key + 3, 0.02, 0.4, kScenarioStep_s);
  }
  return state;
}

std::vector<TrafficObject> foresee(const DriveCase& drive, std::int64_t step, const State& ego,
                                   const DriveOptions& options, Errors& errors) {
  std::vector<TrafficObject> objects;
  const std::int64_t seen = std::max<std::int64_t>(0, step - options.delay_steps);
  const double first_s = -kScenarioStep_s * static_cast<double>(step - seen);
  for (const ads::Obstacle& obstacle : drive.scenario->obstacles) {
    const ads::ScenarioState* now = state_at(obstacle, seen);
    if (obstacle.id == drive.replaced || now == nullptr) {
      continue;
    }
    const bool is_far = (now->position_m - Eigen::Vector2d(ego.x_m, ego.y_m)).norm() > 90.0;
    if (errors.size() > 0.0 && is_far) {
      continue;
    }
    TrafficObject object{.id = static_cast<std::uint64_t>(obstacle.id),
                         .length_m = obstacle.length_m,
                         .width_m = obstacle.width_m};
    if (options.foresight == Foresight::kConstantSpeed) {
      object.ways = lane_following(*drive.scenario, perceived(obstacle, *now, errors), first_s);
    } else {
      PredictedWay way{.probability = 1.0, .first_s = first_s, .step_s = kScenarioStep_s};
      for (std::int64_t later = seen; const auto* state = state_at(obstacle, later); ++later) {
        way.states.push_back(predicted(*state));
        way.states.back().along_stddev_m = 0.1;
        way.states.back().across_stddev_m = 0.1;
        if (obstacle.is_static) {
          break;
        }
      }
      object.ways.push_back(way);
    }
    objects.push_back(object);
  }
  return objects;
}

// The vehicle's response to commands: dead time and lag, in steps of 10 ms; control at 50 Hz with
// localization's estimate.
class SimulatedVehicle {
 public:
  SimulatedVehicle(const Vehicle& vehicle, const State& initial)
      : vehicle_(vehicle), state_(initial) {}

  // Drives one step of the scenario after `plan`.
  void drive_along(const Trajectory& plan, double from_s, Errors& errors) {
    ads::Path path{.start_s = plan.start_s, .step_s = plan.step_s};
    for (const State& state : plan.states) {
      path.points.push_back({.x_m = state.x_m,
                             .y_m = state.y_m,
                             .heading_rad = state.heading_rad,
                             .curvature_per_m = std::tan(state.steering_rad) / vehicle_.wheelbase_m,
                             .speed_mps = state.speed_mps,
                             .acceleration_mps2 = state.acceleration_mps2});
    }
    for (int tick = 0; tick < 10; ++tick) {
      const double now = from_s + 0.01 * tick;
      seen_.push_back(estimate(errors));
      if (seen_.size() > 3) {
        seen_.pop_front();
      }
      if (tick % 2 == 0) {
        const double seen_s = now - 0.01 * static_cast<double>(seen_.size() - 1);
        commands_.push_back({now, tracker_.follow(path, seen_.front(), seen_s, now)});
      }
      advance(now);
    }
    const State wanted = plan.at(from_s + kScenarioStep_s);
    tracking_m_ = std::hypot(state_.x_m - wanted.x_m, state_.y_m - wanted.y_m);
  }

  [[nodiscard]] const State& state() const { return state_; }
  [[nodiscard]] double tracking_m() const { return tracking_m_; }
  // Localization's estimate.
  [[nodiscard]] State estimated() const {
    State state = state_;
    if (!seen_.empty()) {
      const ads::Motion& motion = seen_.back();
      state.x_m = motion.x_m;
      state.y_m = motion.y_m;
      state.heading_rad = motion.heading_rad;
      state.speed_mps = motion.speed_mps;
    }
    return state;
  }

 private:
  ads::Motion estimate(Errors& errors) const {
    return {
        .x_m = state_.x_m + errors.wander(1, 0.12, 30.0, 0.01) + errors.wander(2, 0.04, 0.3, 0.01),
        .y_m = state_.y_m + errors.wander(3, 0.12, 30.0, 0.01) + errors.wander(4, 0.04, 0.3, 0.01),
        .heading_rad = state_.heading_rad + errors.wander(5, 0.006, 2.0, 0.01),
        .speed_mps = std::max(0.0, state_.speed_mps + errors.wander(6, 0.06, 0.5, 0.01)),
        .acceleration_mps2 = state_.acceleration_mps2,
        .steering_rad = state_.steering_rad};
  }

  void advance(double now) {
    ads::Actuation command{.steering_rad = state_.steering_rad,
                           .acceleration_mps2 = state_.acceleration_mps2};
    for (const auto& [time, given] : commands_) {
      if (time <= now - 0.1 + 1e-9) {
        command = given;
      }
    }
    const double rate =
        std::clamp((command.steering_rad - state_.steering_rad) / 0.01,
                   -vehicle_.steering_rate_max_radps, vehicle_.steering_rate_max_radps);
    // As in the world: what is asked for is there after the delay. It does not drive backwards.
    state_.acceleration_mps2 = state_.speed_mps <= 0.0 ? std::max(0.0, command.acceleration_mps2)
                                                       : command.acceleration_mps2;
    state_ = drive(vehicle_, state_, {.jerk_mps3 = 0.0, .steering_rate_radps = rate}, 0.01);
    state_.speed_mps = std::max(0.0, state_.speed_mps);
  }

  Vehicle vehicle_;
  State state_;
  ads::Tracker tracker_{ads::TrackerConfig{}};
  std::deque<ads::Motion> seen_;
  std::deque<std::pair<double, ads::Actuation>> commands_;
  double tracking_m_ = 0.0;
};

struct Miss {
  double along = 0.0;
  double across = 0.0;
  double heading = 0.0;
  double speed = 0.0;

  [[nodiscard]] double size() const {
    return std::abs(along) + std::abs(across) + 10.0 * std::abs(heading) + std::abs(speed);
  }
};

Miss miss_of(const Goal& goal, const State& state) {
  const Eigen::Vector2d delta(state.x_m - goal.centre.x_m, state.y_m - goal.centre.y_m);
  const Eigen::Vector2d ahead = ads::direction(goal.centre.heading_rad);
  const double middle = 0.5 * (goal.heading_rad.low + goal.heading_rad.high);
  const double half = 0.5 * (goal.heading_rad.high - goal.heading_rad.low);
  return {.along = outside(delta.dot(ahead), -goal.half_length_m, goal.half_length_m),
          .across = outside(ads::cross(ahead, delta), -goal.half_width_m, goal.half_width_m),
          .heading = outside(wrapped(state.heading_rad - middle), -half, half),
          .speed = outside(state.speed_mps, goal.speed_mps.low, goal.speed_mps.high)};
}

bool is_on_road(const ads::Scenario& scenario, const State& state) {
  return std::any_of(scenario.lanelets.begin(), scenario.lanelets.end(), [&](const auto& entry) {
    return ads::contains(entry.second.polygon_m(), {state.x_m, state.y_m});
  });
}

}  // namespace

DriveCase given_case(const ads::Scenario& scenario) {
  const ads::PlanningProblem& problem = scenario.problem();
  const ads::GoalState& goal = problem.goals.front();
  const ads::Box& box = goal.boxes.at(0);
  DriveCase drive{.name = scenario.name + "/given", .scenario = &scenario};
  drive.initial = {.x_m = problem.initial.position_m.x(),
                   .y_m = problem.initial.position_m.y(),
                   .heading_rad = problem.initial.heading_rad,
                   .speed_mps = problem.initial.speed_mps};
  drive.goal.centre = {
      .x_m = box.center_m.x(), .y_m = box.center_m.y(), .heading_rad = box.heading_rad};
  drive.goal.half_length_m = box.length_m / 2.0;
  drive.goal.half_width_m = box.width_m / 2.0;
  if (goal.heading_rad) {
    drive.goal.heading_rad = {goal.heading_rad->low, goal.heading_rad->high};
  }
  if (goal.speed_mps) {
    drive.goal.speed_mps = {goal.speed_mps->low, goal.speed_mps->high};
  }
  drive.goal.time_s = {kScenarioStep_s * static_cast<double>(goal.first_step),
                       kScenarioStep_s * static_cast<double>(goal.last_step)};
  return drive;
}

std::vector<DriveCase> recorded_cases(const ads::Scenario& scenario) {
  std::vector<DriveCase> cases;
  for (const ads::Obstacle& obstacle : scenario.obstacles) {
    for (const std::int64_t first : {0, 20, 40}) {
      const auto count = static_cast<std::int64_t>(obstacle.states.size());
      const std::int64_t last = std::min<std::int64_t>(count - 1, first + 110);
      if (last - first < 55 || obstacle.is_static) {
        continue;
      }
      const ads::ScenarioState& from = obstacle.states[static_cast<std::size_t>(first)];
      const ads::ScenarioState& to = obstacle.states[static_cast<std::size_t>(last - 5)];
      if (lanelet_at(scenario, from.position_m, from.heading_rad) == 0 ||
          lanelet_at(scenario, to.position_m, to.heading_rad) == 0) {
        continue;
      }
      DriveCase drive{
          .name = scenario.name + "/" + std::to_string(obstacle.id) + "@" + std::to_string(first),
          .scenario = &scenario,
          .replaced = obstacle.id,
          .first_step = first};
      drive.initial = {.x_m = from.position_m.x(),
                       .y_m = from.position_m.y(),
                       .heading_rad = from.heading_rad,
                       .speed_mps = from.speed_mps};
      drive.goal = {.centre = {.x_m = to.position_m.x(),
                               .y_m = to.position_m.y(),
                               .heading_rad = to.heading_rad},
                    .half_length_m = 1.1,
                    .half_width_m = 0.85,
                    .heading_rad = {to.heading_rad - 0.0873, to.heading_rad + 0.0873},
                    .speed_mps = {std::max(0.0, to.speed_mps - 3.0), to.speed_mps + 3.0},
                    .time_s = {kScenarioStep_s * static_cast<double>(last - first - 10),
                               kScenarioStep_s * static_cast<double>(last - first)}};
      cases.push_back(drive);
    }
  }
  return cases;
}

Road make_road(const ads::Scenario& scenario, const State& from, const Pose& to) {
  const std::int64_t start = nearest_lanelet(scenario, {from.x_m, from.y_m}, from.heading_rad);
  const std::int64_t end = nearest_lanelet(scenario, {to.x_m, to.y_m}, to.heading_rad);
  // Dijkstra over the lane graph; a change of lanes costs as much as some way.
  std::map<std::int64_t, std::pair<double, std::int64_t>> reached;  // Cost, from where.
  std::map<std::int64_t, bool> done;
  reached[start] = {0.0, 0};
  while (true) {
    std::int64_t best = 0;
    for (const auto& [id, entry] : reached) {
      if (!done[id] && (best == 0 || entry.first < reached[best].first)) {
        best = id;
      }
    }
    if (best == 0 || best == end) {
      break;
    }
    done[best] = true;
    const ads::Lanelet& lanelet = scenario.lanelets.at(best);
    const auto relax = [&](std::int64_t id, double cost) {
      const double total = reached[best].first + cost;
      if (!reached.contains(id) || total < reached[id].first) {
        reached[id] = {total, best};
      }
    };
    const double length = ads::Polyline(centre_of(lanelet)).length_m();
    for (const std::int64_t id : lanelet.successors) {
      relax(id, length);
    }
    for (const auto& neighbour : {lanelet.left, lanelet.right}) {
      if (neighbour && neighbour->is_same_direction) {
        relax(neighbour->id, 20.0);
      }
    }
  }
  std::vector<std::int64_t> path;
  for (std::int64_t id = reached.contains(end) ? end : start; id != 0; id = reached[id].second) {
    path.insert(path.begin(), id);
  }
  // Backwards from the goal, along the lane that leads to it, as long as that lies beside the way.
  const auto beside = [&](std::int64_t one, std::int64_t other) {
    for (const bool to_left : {true, false}) {
      for (std::int64_t id = one; id != 0;) {
        if (id == other) {
          return true;
        }
        const ads::Lanelet& lanelet = scenario.lanelets.at(id);
        const auto& next = to_left ? lanelet.left : lanelet.right;
        id = next && next->is_same_direction ? next->id : 0;
      }
    }
    return false;
  };
  std::vector<std::int64_t> lanes;
  std::int64_t piece = path.back();
  for (std::size_t index = path.size(); index-- > 0;) {
    if (!lanes.empty() && beside(lanes.front(), path[index])) {
      continue;
    }
    if (!lanes.empty()) {
      piece = path[index];
      for (const std::int64_t before : scenario.lanelets.at(lanes.front()).predecessors) {
        if (beside(before, path[index])) {
          piece = before;
        }
      }
    }
    lanes.insert(lanes.begin(), piece);
  }
  // Beyond the goal, and before the start.
  for (int count = 0; count < 3 && !scenario.lanelets.at(lanes.back()).successors.empty();
       ++count) {
    lanes.push_back(scenario.lanelets.at(lanes.back()).successors.front());
  }
  for (int count = 0; count < 1 && !scenario.lanelets.at(lanes.front()).predecessors.empty();
       ++count) {
    lanes.insert(lanes.begin(), scenario.lanelets.at(lanes.front()).predecessors.front());
  }
  std::vector<RoadPoint> points;
  for (const std::int64_t lane : lanes) {
    const ads::Polyline line = ads::Polyline(centre_of(scenario.lanelets.at(lane))).resampled(1.0);
    std::size_t skip = 0;
    if (!points.empty()) {
      const Eigen::Vector2d gap =
          line.points_m().front() - Eigen::Vector2d(points.back().x_m, points.back().y_m);
      if (gap.norm() > 1.0) {
        for (int count = 0; count < 8 && points.size() > 1; ++count) {
          points.pop_back();
        }
        skip = std::min<std::size_t>(8, line.points_m().size() - 1);
      } else {
        skip = 1;
      }
    }
    for (std::size_t index = skip; index < line.points_m().size(); ++index) {
      const Eigen::Vector2d& place = line.points_m()[index];
      const Eigen::Vector2d side =
          ads::left_of(ads::direction(line.heading_at(line.arclengths_m()[index])));
      RoadPoint point{.x_m = place.x(), .y_m = place.y()};
      const auto offset_of = [&](const std::vector<Eigen::Vector2d>& other) {
        const ads::Polyline::Projection projection = ads::Polyline(other).project(place);
        const Eigen::Vector2d near = ads::Polyline(other).point_at(projection.along_m);
        return side.dot(near - place);
      };
      point.speed_limit_mps = scenario.lanelets.at(lane).speed_limit_mps.value_or(0.0);
      std::int64_t leftmost = lane;
      for (auto next = scenario.lanelets.at(leftmost).left; next && next->is_same_direction;
           next = scenario.lanelets.at(leftmost).left) {
        leftmost = next->id;
      }
      std::int64_t rightmost = lane;
      for (auto next = scenario.lanelets.at(rightmost).right; next && next->is_same_direction;
           next = scenario.lanelets.at(rightmost).right) {
        rightmost = next->id;
      }
      point.left_edge_m = offset_of(scenario.lanelets.at(leftmost).left_m);
      point.right_edge_m = -offset_of(scenario.lanelets.at(rightmost).right_m);
      points.push_back(point);
    }
  }
  Road road(points);
  for (const auto& [id, lanelet] : scenario.lanelets) {
    road.add_lane(centre_of(lanelet));
  }
  return road;
}

DriveResult drive_through(const DriveCase& drive, const PlannerConfig& config,
                          const DriveOptions& options) {
  DriveResult result;
  const Road road = make_road(*drive.scenario, drive.initial, drive.goal.centre);
  Planner planner(config);
  State ego = drive.initial;
  SimulatedVehicle simulated(config.vehicle, ego);
  Errors errors(options.noise, options.seed);
  const auto end =
      static_cast<std::int64_t>(std::llround(drive.goal.time_s.high / kScenarioStep_s));
  int cycles = 0;
  for (std::int64_t step = 0; step <= end; ++step) {
    const double now = kScenarioStep_s * static_cast<double>(step);
    const std::int64_t world_step = drive.first_step + step;
    for (const ads::Obstacle& obstacle : drive.scenario->obstacles) {
      const ads::ScenarioState* state = state_at(obstacle, world_step);
      if (state == nullptr || obstacle.id == drive.replaced) {
        continue;
      }
      const double gap = ads::distance_m(box_of(config.vehicle, ego), box_of(obstacle, *state));
      if (gap < result.smallest_gap_m) {
        result.smallest_gap_m = gap;
        result.gap_object = obstacle.id;
        result.gap_s = now;
      }
    }
    for (const ads::Obstacle& own : drive.scenario->obstacles) {
      const ads::ScenarioState* recorded =
          own.id == drive.replaced ? state_at(own, world_step) : nullptr;
      for (const ads::Obstacle& obstacle : drive.scenario->obstacles) {
        const ads::ScenarioState* state = state_at(obstacle, world_step);
        if (recorded != nullptr && state != nullptr && obstacle.id != own.id) {
          ads::Box box = box_of(own, *recorded);
          box.length_m = config.vehicle.length_m;
          box.width_m = config.vehicle.width_m;
          result.recorded_gap_m =
              std::min(result.recorded_gap_m, ads::distance_m(box, box_of(obstacle, *state)));
        }
      }
    }
    result.on_road = result.on_road && is_on_road(*drive.scenario, ego);
    if (now >= drive.goal.time_s.low - 1e-9) {
      const Miss miss = miss_of(drive.goal, ego);
      if (miss.size() < result.goal_miss_m) {
        result.goal_miss_m = miss.size();
        char text[100];
        std::snprintf(text, sizeof text, "along %.2f across %.2f heading %.3f speed %.2f",
                      miss.along, miss.across, miss.heading, miss.speed);
        result.goal_miss = text;
      }
      if (miss.size() == 0.0) {
        result.reached = true;
        result.reached_s = now;
        break;
      }
    }
    if (step == end) {
      break;
    }
    Situation situation{.now_s = now,
                        .ego = options.with_model ? simulated.estimated() : ego,
                        .is_driving = step > 0,
                        .road = &road,
                        .objects = foresee(drive, world_step, ego, options, errors),
                        .goal = drive.goal};
    const double before = cpu_ms();
    const Plan plan = planner.plan(situation);
    const double ms = cpu_ms() - before;
    result.time_mean_ms += ms;
    result.time_max_ms = std::max(result.time_max_ms, ms);
    ++cycles;
    if (options.is_verbose) {
      const RoadPlace place = road.locate(ego.x_m, ego.y_m);
      const RoadPlace goal = road.locate(drive.goal.centre.x_m, drive.goal.centre.y_m);
      std::printf(
          "%5.1f s=%7.2f d=%6.2f v=%5.2f a=%5.2f h=%6.3f | goal ds=%7.2f d=%6.2f | %s ms=%.1f\n",
          now, place.along_m, place.offset_m, ego.speed_mps, ego.acceleration_mps2,
          ego.heading_rad - place.heading_rad, goal.along_m - place.along_m, goal.offset_m,
          plan.reason.c_str(), ms);
      for (const ads::Obstacle& obstacle : drive.scenario->obstacles) {
        const ads::ScenarioState* state = state_at(obstacle, world_step);
        if (state == nullptr || obstacle.id == drive.replaced) {
          continue;
        }
        const RoadPlace other = road.locate(state->position_m.x(), state->position_m.y());
        const double ds = other.along_m - place.along_m;
        if (std::abs(ds) < 30.0 && std::abs(other.offset_m - place.offset_m) < 5.0) {
          std::printf("        %lld ds=%6.2f dd=%5.2f v=%5.2f gap=%.2f\n",
                      static_cast<long long>(obstacle.id), ds, other.offset_m - place.offset_m,
                      state->speed_mps,
                      ads::distance_m(box_of(config.vehicle, ego), box_of(obstacle, *state)));
        }
      }
    }
    const State before_step = ego;
    if (options.with_model) {
      simulated.drive_along(plan.nominal, now, errors);
      ego = simulated.state();
      result.tracking_max_m = std::max(result.tracking_max_m, simulated.tracking_m());
    } else {
      ego = plan.nominal.at(now + kScenarioStep_s);
    }
    result.acceleration_min_mps2 = std::min(result.acceleration_min_mps2, ego.acceleration_mps2);
    result.acceleration_max_mps2 = std::max(result.acceleration_max_mps2, ego.acceleration_mps2);
    result.lateral_max_mps2 =
        std::max(result.lateral_max_mps2, std::abs(ego.speed_mps * yaw_rate(config.vehicle, ego)));
    result.jerk_max_mps3 =
        std::max(result.jerk_max_mps3,
                 std::abs(ego.acceleration_mps2 - before_step.acceleration_mps2) / kScenarioStep_s);
  }
  result.collided = result.smallest_gap_m <= 0.0;
  result.time_mean_ms /= std::max(1, cycles);
  return result;
}

}  // namespace motion_planning

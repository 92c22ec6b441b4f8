#include "minimal_risk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "motion_planning_tuning.h"
#include "optimizer.h"

namespace motion_planning {
namespace {

// The line of a trajectory, by its length.
class Line {
 public:
  explicit Line(const Trajectory& trajectory) {
    for (const State& state : trajectory.states) {
      const double way = states_.empty() ? 0.0
                                         : std::hypot(state.x_m - states_.back().x_m,
                                                      state.y_m - states_.back().y_m);
      if (states_.empty() || way > 1e-3) {
        alongs_m_.push_back(states_.empty() ? 0.0 : alongs_m_.back() + way);
        states_.push_back(state);
      }
    }
  }

  [[nodiscard]] State at(double along_m) const {
    if (states_.size() < 2 || along_m >= alongs_m_.back()) {
      State end = states_.back();
      const double beyond = along_m - alongs_m_.back();
      end.x_m += beyond * std::cos(end.heading_rad);
      end.y_m += beyond * std::sin(end.heading_rad);
      end.steering_rad = states_.size() < 2 ? end.steering_rad : 0.0;
      return end;
    }
    const auto after = std::upper_bound(alongs_m_.begin(), alongs_m_.end(), along_m);
    const auto index = static_cast<std::size_t>(after - alongs_m_.begin());
    const double share =
        (along_m - alongs_m_[index - 1]) / (alongs_m_[index] - alongs_m_[index - 1]);
    return between(states_[index - 1], states_[index], share);
  }

 private:
  std::vector<State> states_;
  std::vector<double> alongs_m_;
};

// Drives on for `after_s`, then brakes.
Trajectory braked(const Line& line, const Trajectory& along, double braking_mps2, double after_s) {
  Trajectory stop{.start_s = along.start_s, .step_s = along.step_s, .states = {}};
  double speed = along.states.front().speed_mps;
  double acceleration = along.states.front().acceleration_mps2;
  double driven = 0.0;
  const double step = stop.step_s;
  const auto standing = static_cast<std::size_t>(kMinimalRisk.standing_s / step);
  for (std::size_t stood = 0; stood < standing && stop.states.size() < 400;) {
    State state = line.at(driven);
    state.speed_mps = speed;
    state.acceleration_mps2 = speed > 0.0 ? acceleration : 0.0;
    stop.states.push_back(state);
    stood += speed > 0.0 ? 0 : 1;
    const double time = step * static_cast<double>(stop.states.size());
    const double wanted = time > after_s ? -braking_mps2 : 0.0;
    acceleration += std::clamp(wanted - acceleration, -kMinimalRisk.jerk_mps3 * step,
                               kMinimalRisk.jerk_mps3 * step);
    const double next = std::max(0.0, speed + step * acceleration);
    driven += 0.5 * step * (speed + next);
    speed = next;
  }
  return stop;
}

// Soon is certain; what is predicted for later may well not come.
double price_of_hit(const Trajectory& stop, const Verdict& verdict) {
  if (!std::isfinite(verdict.hit_s)) {
    return 0.0;
  }
  const double impact_mps = stop.at(stop.start_s + verdict.hit_s).speed_mps;
  return (kMinimalRisk.hit + kMinimalRisk.hit_per_mps * impact_mps) /
         std::pow(kMinimalRisk.hit_soon_s + verdict.hit_s, 3.0);
}

// Whether a driver from behind, on the same line, would hit the vehicle.
bool is_run_into(const Problem& problem, const Trajectory& stop, const Occupant& behind) {
  const State& start = stop.states.front();
  const double distance = std::cos(behind.heading_rad) * (start.x_m - behind.x_m) +
                          std::sin(behind.heading_rad) * (start.y_m - behind.y_m);
  double gap = distance - behind.half_length_m - problem.vehicle.length_m / 2.0;
  double speed = behind.speed_mps;
  for (std::size_t index = 0; index < stop.states.size(); ++index) {
    const double time = stop.step_s * static_cast<double>(index);
    const double own = stop.states[index].speed_mps;
    if (time > kMinimalRisk.reaction_s && speed > own) {
      speed = std::max(own, speed - stop.step_s * kMinimalRisk.braking_mps2);
    }
    gap += stop.step_s * (own - speed);
    if (gap < 0.0) {
      return true;
    }
  }
  return false;
}

const std::vector<Road>& lanes_of(const Problem& problem) {
  static const std::vector<Road> none;
  return problem.lanes == nullptr ? none : *problem.lanes;
}

// The objects that approach from behind on each lane beyond the prediction horizon.
class Arrivals {
 public:
  Arrivals(const Problem& problem, const Traffic& unyielding) : problem_(problem) {
    const auto step =
        std::min(unyielding.steps(), static_cast<std::size_t>(kMinimalRisk.look_s / kStep_s));
    for (const Road& lane : lanes_of(problem)) {
      comers_.emplace_back();
      for (const Occupant& other : unyielding.at(step)) {
        if (other.probability < kProbabilityMin || other.speed_mps <= kMinimalRisk.moving_mps) {
          continue;
        }
        const RoadPlace from = lane.locate(other.x_m, other.y_m);
        if (std::cos(other.heading_rad - from.heading_rad) > kMinimalRisk.aligned) {
          comers_.back().push_back({.along_m = from.along_m,
                                    .offset_m = from.offset_m,
                                    .half_width_m = other.half_width_m,
                                    .speed_mps = other.speed_mps});
        }
      }
    }
  }

  // When the first of them would reach the vehicle's position; infinite if there is none, or no
  // lane is known.
  [[nodiscard]] double first_s(const State& end) const {
    double first = std::numeric_limits<double>::infinity();
    for (std::size_t index = 0; index < comers_.size(); ++index) {
      if (comers_[index].empty()) {
        continue;
      }
      const RoadPlace place = lanes_of(problem_)[index].locate(end.x_m, end.y_m);
      if (std::abs(place.offset_m) > kMinimalRisk.lane_width_m / 2.0) {
        continue;
      }
      for (const Comer& comer : comers_[index]) {
        const double way = place.along_m - comer.along_m;
        const double beside = comer.half_width_m + problem_.vehicle.width_m / 2.0;
        if (way > 0.0 && std::abs(comer.offset_m - place.offset_m) < beside) {
          first = std::min(first, kMinimalRisk.look_s + way / comer.speed_mps);
        }
      }
    }
    return first;
  }

 private:
  struct Comer {
    double along_m = 0.0;
    double offset_m = 0.0;
    double half_width_m = 0.0;
    double speed_mps = 0.0;
  };

  const Problem& problem_;
  std::vector<std::vector<Comer>> comers_;  // For each lane.
};

// Whether both lanes lead the same way for as far as the vehicle may go until it stands: of lanes
// that part far ahead, each is known from the map's begin on.
bool is_same_ahead(const Road& one, double one_m, const Road& other, double other_m,
                   double reach_m) {
  for (double ahead = 0.0; ahead < reach_m + kMinimalRisk.step_m; ahead += kMinimalRisk.step_m) {
    const Pose a = one.pose(one_m + ahead, 0.0);
    const Pose b = other.pose(other_m + ahead, 0.0);
    if (std::hypot(a.x_m - b.x_m, a.y_m - b.y_m) > kMinimalRisk.same_m) {
      return false;
    }
  }
  return true;
}

// Drives on at the present speed, into a lane.
Trajectory into_lane(const Problem& problem, const Road& lane, const RoadPlace& start,
                     double start_s) {
  const double duration =
      std::max(kMinimalRisk.shortest_s, std::abs(start.offset_m) / kMinimalRisk.sideways_mps);
  std::vector<Pose> guess;
  for (std::size_t step = 1; step <= problem.traffic.steps(); ++step) {
    const double time = kStep_s * static_cast<double>(step);
    const double along = start.along_m + std::max(0.0, problem.start.speed_mps) * time;
    const double share = std::min(1.0, time / duration);
    const double left_over = 1.0 - share * share * (3.0 - 2.0 * share);
    guess.push_back(lane.pose(along, start.offset_m * left_over));
  }
  const Problem on_lane{
      .vehicle = problem.vehicle, .road = lane, .traffic = problem.traffic, .start = problem.start};
  return trajectory_of(problem.vehicle, Optimizer(on_lane).follow(guess), start_s);
}

Stop stop_along(const Problem& problem, const Traffic& unyielding, const Arrivals& arrivals,
                const Trajectory& along, StopLine kind) {
  const Line line(along);
  const State& start = along.states.front();
  // Objects behind on the same line see the vehicle brake.
  std::vector<bool> is_behind;
  std::vector<const Occupant*> followers;
  for (const Occupant& occupant : problem.traffic.at(0)) {
    is_behind.resize(std::max(is_behind.size(), occupant.object + 1), false);
    const double dx = occupant.x_m - start.x_m;
    const double dy = occupant.y_m - start.y_m;
    const double ahead = dx * std::cos(start.heading_rad) + dy * std::sin(start.heading_rad);
    const double left = -dx * std::sin(start.heading_rad) + dy * std::cos(start.heading_rad);
    const bool is_aligned =
        std::cos(occupant.heading_rad - start.heading_rad) > kMinimalRisk.aligned;
    const double beside = occupant.half_width_m + problem.vehicle.width_m / 2.0;
    const bool is_follower = std::abs(left) < beside;
    if (ahead < -problem.vehicle.length_m / 2.0 && is_aligned &&
        (is_follower || kind == StopLine::kOwnLane)) {
      is_behind[occupant.object] = true;
      if (is_follower) {
        followers.push_back(&occupant);
      }
    }
  }
  Stop best{.price = std::numeric_limits<double>::infinity()};
  const auto consider = [&](double braking, double after_s) {
    Trajectory stop = braked(line, along, braking, after_s);
    const Verdict verdict =
        judge(problem.vehicle, stop, problem.traffic, kMinimalRisk.look_s, is_behind);
    const Verdict likely = judge(problem.vehicle, stop, problem.traffic, kMinimalRisk.look_s,
                                 is_behind, kMinimalRisk.likely);
    double price = braking + after_s;
    if (std::isfinite(verdict.hit_s)) {
      price +=
          std::max(price_of_hit(stop, likely), kMinimalRisk.possible * price_of_hit(stop, verdict));
    } else if (verdict.smallest_gap_m < kMinimalRisk.gap_m) {
      price += kMinimalRisk.gap * (kMinimalRisk.gap_m - verdict.smallest_gap_m);
    }
    const double arrival_s = arrivals.first_s(stop.states.back());
    const auto pressed_s = [&](double probability_min) {
      const Verdict pressed =
          judge(problem.vehicle, stop, unyielding, kMinimalRisk.look_s, {}, probability_min);
      return pressed.smallest_gap_m < std::min(kMinimalRisk.pressed_m, verdict.smallest_gap_m)
                 ? pressed.gap_s
                 : arrival_s;
    };
    const double possible_s = pressed_s(kProbabilityMin);
    const bool is_too_late =
        std::isfinite(possible_s) && std::ranges::any_of(followers, [&](const Occupant* follower) {
          return is_run_into(problem, stop, *follower);
        });
    price += std::max(kMinimalRisk.not_yielding / (1.0 + pressed_s(kMinimalRisk.likely)),
                      kMinimalRisk.possible * kMinimalRisk.not_yielding / (1.0 + possible_s));
    price += is_too_late ? kMinimalRisk.too_late : 0.0;
    if (price < best.price) {
      best = {.trajectory = std::move(stop),
              .braking_mps2 = braking,
              .hit_s = likely.hit_s,
              .price = price};
    }
  };
  for (const double braking : kMinimalRisk.brakings_mps2) {
    consider(braking, 0.0);
  }
  if (kind == StopLine::kOtherLane) {
    consider(kMinimalRisk.brakings_mps2.front(), kMinimalRisk.driving_on_s);
  }
  return best;
}

}  // namespace

Stop stop_along(const Problem& problem, const Traffic& unyielding, const Trajectory& along,
                StopLine kind) {
  return stop_along(problem, unyielding, Arrivals(problem, unyielding), along, kind);
}

Stop safest_stop(const Problem& problem, const Traffic& unyielding, const Trajectory& nominal) {
  const Arrivals arrivals(problem, unyielding);
  Stop best = stop_along(problem, unyielding, arrivals, nominal, StopLine::kPlan);
  const double speed = std::max(0.0, problem.start.speed_mps);
  const double reach_m = speed * kMinimalRisk.driving_on_s +
                         speed * speed / (2.0 * kMinimalRisk.brakings_mps2.front());
  std::vector<std::pair<const Road*, double>> tried;
  for (const Road& lane : lanes_of(problem)) {
    const RoadPlace start = lane.locate(problem.start.x_m, problem.start.y_m);
    const double changes = std::abs(start.offset_m) / kMinimalRisk.lane_width_m;
    if (changes > kMinimalRisk.lanes_beside ||
        start.along_m > lane.length_m() - kMinimalRisk.length_min_m ||
        std::cos(problem.start.heading_rad - start.heading_rad) < kMinimalRisk.aligned) {
      continue;
    }
    if (std::ranges::any_of(tried, [&](const auto& other) {
          return is_same_ahead(lane, start.along_m, *other.first, other.second, reach_m);
        })) {
      continue;
    }
    tried.emplace_back(&lane, start.along_m);
    Stop other =
        stop_along(problem, unyielding, arrivals, into_lane(problem, lane, start, nominal.start_s),
                   changes < 0.5 ? StopLine::kOwnLane : StopLine::kOtherLane);
    other.price += kMinimalRisk.leaving_the_plan + kMinimalRisk.changing_lane * changes;
    if (other.price < best.price) {
      best = std::move(other);
    }
  }
  return best;
}

}  // namespace motion_planning

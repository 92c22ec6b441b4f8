#include "trajectory.h"

#include <algorithm>
#include <cmath>

#include "common/plane.h"
#include "common/scalar.h"
#include "motion_planning_tuning.h"

namespace motion_planning {
namespace {

using ads::kInfinity;

ads::Box box_of(const Vehicle& vehicle, const State& state) {
  return {.center_m = {state.x_m, state.y_m},
          .heading_rad = state.heading_rad,
          .length_m = vehicle.length_m,
          .width_m = vehicle.width_m};
}

ads::Box box_of(const Occupant& occupant) {
  return {.center_m = {occupant.x_m, occupant.y_m},
          .heading_rad = occupant.heading_rad,
          .length_m = 2.0 * occupant.half_length_m,
          .width_m = 2.0 * occupant.half_width_m};
}

// An optimized way may reverse. The vehicle stands then, and follows the way's speeds and steering
// from where it stands. The optimizer leaves speeds a little below 0 at a stop; these count as 0.
void stand_instead_of_reversing(const Vehicle& vehicle, double step_s, std::vector<State>& states) {
  const auto is_reversing = [](const State& state) {
    return state.speed_mps < kTrajectory.stop_mps;
  };
  if (std::ranges::none_of(states, is_reversing)) {
    for (State& state : states) {
      state.speed_mps = std::max(0.0, state.speed_mps);
    }
    return;
  }
  const auto first =
      std::ranges::find_if(states, [](const State& state) { return state.speed_mps < 0.0; });
  for (auto state = first; state != states.end(); ++state) {
    if (state->speed_mps <= 0.0) {
      state->speed_mps = 0.0;
      state->acceleration_mps2 = 0.0;
    }
    if (state == states.begin()) {
      continue;
    }
    const State& from = *(state - 1);
    const double way = 0.5 * step_s * (from.speed_mps + state->speed_mps);
    const double turn = 0.5 * step_s * (yaw_rate(vehicle, from) + yaw_rate(vehicle, *state));
    // The rear axle moves along the heading.
    const double lever = vehicle.centre_to_rear_axle_m;
    state->heading_rad = from.heading_rad + turn;
    const double middle = from.heading_rad + 0.5 * turn;
    state->x_m = from.x_m + way * std::cos(middle) +
                 lever * (std::cos(state->heading_rad) - std::cos(from.heading_rad));
    state->y_m = from.y_m + way * std::sin(middle) +
                 lever * (std::sin(state->heading_rad) - std::sin(from.heading_rad));
  }
}

}  // namespace

State Trajectory::at(double time_s) const {
  const double last = static_cast<double>(states.size() - 1);
  const double place = std::clamp((time_s - start_s) / step_s, 0.0, last);
  const auto index = static_cast<std::size_t>(place);
  return between(states[index], states[std::min(index + 1, states.size() - 1)],
                 place - static_cast<double>(index));
}

Trajectory trajectory_of(const Vehicle& vehicle, const Way& way, double start_s) {
  constexpr double kHalf_s = kStep_s / 2.0;
  Trajectory trajectory{.start_s = start_s, .step_s = kHalf_s, .states = {}};
  for (std::size_t step = 0; step < way.inputs.size(); ++step) {
    trajectory.states.push_back(way.states[step]);
    trajectory.states.push_back(drive(vehicle, way.states[step], way.inputs[step], kHalf_s));
  }
  trajectory.states.push_back(way.states.back());
  stand_instead_of_reversing(vehicle, kHalf_s, trajectory.states);
  return trajectory;
}

Verdict judge(const Vehicle& vehicle, const Trajectory& trajectory, const Traffic& traffic,
              double until_s, const std::vector<bool>& is_ignored, double probability_min) {
  constexpr double kRounding = 1e-9;
  Verdict verdict{.smallest_gap_m = kInfinity, .hit_s = kInfinity};
  const double reach = 0.5 * std::hypot(vehicle.length_m, vehicle.width_m);
  for (std::size_t step = 0; step <= traffic.steps(); ++step) {
    const double time = kStep_s * static_cast<double>(step);
    if (time > until_s) {
      break;
    }
    const State state = trajectory.at(trajectory.start_s + time);
    verdict.acceleration_min_mps2 =
        std::min(verdict.acceleration_min_mps2, state.acceleration_mps2);
    verdict.acceleration_max_mps2 =
        std::max(verdict.acceleration_max_mps2, state.acceleration_mps2);
    verdict.lateral_max_mps2 =
        std::max(verdict.lateral_max_mps2, std::abs(state.speed_mps * yaw_rate(vehicle, state)));
    std::size_t object = 0;
    double touched = 0.0;  // The probability of this object's ways that touch the vehicle.
    for (const Occupant& occupant : traffic.at(step)) {
      touched = occupant.object == object ? touched : 0.0;
      object = occupant.object;
      const bool is_looked_at = is_ignored.empty() || !is_ignored[object];
      const double distance = std::hypot(state.x_m - occupant.x_m, state.y_m - occupant.y_m);
      const double radius = std::hypot(occupant.half_length_m, occupant.half_width_m);
      if (!is_looked_at || distance - radius - reach > verdict.smallest_gap_m) {
        continue;
      }
      const double gap = ads::distance_m(box_of(vehicle, state), box_of(occupant));
      touched += gap <= 0.0 ? occupant.probability : 0.0;
      if (std::max(occupant.probability, touched) < probability_min - kRounding) {
        continue;
      }
      if (gap < verdict.smallest_gap_m) {
        verdict.smallest_gap_m = gap;
        verdict.gap_s = time;
        verdict.object = occupant.object;
      }
      if (gap <= 0.0 && time <= verdict.hit_s) {
        const double other_mps =
            occupant.speed_mps * std::cos(occupant.heading_rad - state.heading_rad);
        const double hit_mps = std::abs(state.speed_mps - other_mps);
        verdict.hit_mps = time < verdict.hit_s ? hit_mps : std::max(verdict.hit_mps, hit_mps);
        verdict.hit_s = time;
      }
    }
  }
  return verdict;
}

double over_edge_m(const Vehicle& vehicle, const Trajectory& trajectory, const Road& road,
                   double until_s) {
  double most = 0.0;
  for (std::size_t index = 0; index < trajectory.states.size(); ++index) {
    if (trajectory.step_s * static_cast<double>(index) > until_s) {
      break;
    }
    const State& state = trajectory.states[index];
    const double cosine = std::cos(state.heading_rad);
    const double sine = std::sin(state.heading_rad);
    const std::size_t hint = road.locate(state.x_m, state.y_m).index;
    for (const double ahead : {-vehicle.length_m / 2.0, 0.0, vehicle.length_m / 2.0}) {
      for (const double aside : {-vehicle.width_m / 2.0, vehicle.width_m / 2.0}) {
        const RoadPlace place = road.locate_near(state.x_m + ahead * cosine - aside * sine,
                                                 state.y_m + ahead * sine + aside * cosine, hint);
        most = std::max({most, place.offset_m - road.left_edge_m(place.along_m),
                         -place.offset_m - road.right_edge_m(place.along_m)});
      }
    }
  }
  return most;
}

}  // namespace motion_planning

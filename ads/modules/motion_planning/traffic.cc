#include "traffic.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/scalar.h"
#include "motion_planning_tuning.h"

namespace motion_planning {
namespace {

using ads::mix;

PredictedState moved(const PredictedState& from, double time_s) {
  PredictedState to = from;
  to.x_m += time_s * from.speed_mps * std::cos(from.heading_rad);
  to.y_m += time_s * from.speed_mps * std::sin(from.heading_rad);
  to.along_stddev_m += std::max(0.0, time_s);
  return to;
}

Occupant occupant(const PredictedState& state, const TrafficObject& object, double probability) {
  const double along = state.along_stddev_m;
  const double across = state.across_stddev_m;
  const double speed = std::max(0.0, state.speed_mps);
  const double first = object.goes_first ? kTraffic.goes_first_s * speed : 0.0;
  // States far ahead are less certain, and can still be avoided later.
  const double trust = probability / (1.0 + along / kTraffic.trusted_stddev_m);
  return {.x_m = state.x_m,
          .y_m = state.y_m,
          .heading_rad = state.heading_rad,
          .cosine = std::cos(state.heading_rad),
          .sine = std::sin(state.heading_rad),
          .half_length_m = object.length_m / 2.0,
          .half_width_m = object.width_m / 2.0,
          .speed_mps = speed,
          .probability = probability,
          .spaces = {{{.along_m = kTraffic.comfort_m + kTraffic.comfort_s * speed + first +
                                  std::min(along, kTraffic.comfort_stddev_m +
                                                      kTraffic.comfort_stddev_s * speed),
                       .beside_m = kTraffic.comfort_beside_m +
                                   std::min(across, kTraffic.comfort_beside_stddev_m),
                       .weight = kTraffic.comfort_weight * trust},
                      {.along_m = kTraffic.safe_m + first +
                                  std::min(0.5 * along,
                                           kTraffic.safe_stddev_m + kTraffic.safe_stddev_s * speed),
                       .beside_m = kTraffic.safe_beside_m +
                                   std::min(0.5 * across, kTraffic.safe_beside_stddev_m),
                       .weight = kTraffic.safe_weight * trust},
                      {.along_m = kTraffic.touch_m,
                       .beside_m = kTraffic.touch_m,
                       .weight = kTraffic.touch_weight * trust}}}};
}

// One object in the road's frame, at one time after the other.
struct Follower {
  std::size_t object = 0;
  double along_m = 0.0;  // At the start.
  double offset_m = 0.0;
  double half_length_m = 0.0;
  double half_width_m = 0.0;
  double lost_m = 0.0;                // How far it is behind what was predicted.
  std::vector<double> alongs_m = {};  // At each step.
  std::vector<double> speeds_mps = {};
  std::vector<double> offsets_m = {};
};

// The braking part of the intelligent driver model.
double braking(double speed_mps, double closing_mps, double gap_m) {
  const double wanted = kTraffic.standing_m + kTraffic.headway_s * speed_mps +
                        std::max(0.0, speed_mps * closing_mps / (2.0 * kTraffic.braking_mps2));
  const double ratio = wanted / std::max(kTraffic.gap_min_m, gap_m);
  return std::clamp(kTraffic.braking_mps2 * (ratio * ratio - 1.0), 0.0, kTraffic.braking_max_mps2);
}

// Slows `follower` down behind `leader`, from `first_step` on; between them `spare_m` is to stay
// free.
void keep_behind(Follower& follower, const Follower& leader, double spare_m,
                 std::size_t first_step = 0) {
  double along = follower.alongs_m.front();
  double speed = follower.speeds_mps.front();
  for (std::size_t step = 0; step + 1 < follower.alongs_m.size(); ++step) {
    const bool is_same_lane =
        step >= first_step && std::abs(follower.offsets_m[step] - leader.offsets_m[step]) <
                                  follower.half_width_m + leader.half_width_m;
    const double gap =
        leader.alongs_m[step] - along - leader.half_length_m - follower.half_length_m - spare_m;
    const double predicted = follower.alongs_m[step + 1] - follower.alongs_m[step];
    speed += kStep_s * kTraffic.speeding_up_mps2;
    if (is_same_lane) {
      speed -= kStep_s * braking(speed, speed - leader.speeds_mps[step], gap);
    }
    speed = std::clamp(speed, 0.0, std::max(0.0, predicted / kStep_s));
    follower.alongs_m[step] = along;
    follower.speeds_mps[step] = speed;
    along += kStep_s * speed;
  }
  follower.alongs_m.back() = along;
  follower.speeds_mps.back() = speed;
}

Follower follower_of(const TrafficObject& object, const PredictedWay& way, const Road& road,
                     std::size_t steps) {
  Follower follower{.half_length_m = object.length_m / 2.0, .half_width_m = object.width_m / 2.0};
  for (std::size_t step = 0; step <= steps; ++step) {
    const PredictedState state = state_at(way, kStep_s * static_cast<double>(step));
    const RoadPlace place = road.locate(state.x_m, state.y_m);
    const bool is_aligned = std::cos(state.heading_rad - place.heading_rad) > kTraffic.aligned;
    // An object that drives across the road is in no queue.
    follower.offsets_m.push_back(is_aligned ? place.offset_m : kTraffic.far_away_m);
    follower.alongs_m.push_back(place.along_m);
    follower.speeds_mps.push_back(state.speed_mps);
  }
  return follower;
}

Follower follower_of(const Vehicle& vehicle, const std::vector<State>& states, const Road& road,
                     std::size_t steps) {
  Follower follower{.half_length_m = vehicle.length_m / 2.0, .half_width_m = vehicle.width_m / 2.0};
  for (std::size_t step = 0; step <= steps; ++step) {
    const State& state = states[std::min(step, states.size() - 1)];
    const RoadPlace place = road.locate(state.x_m, state.y_m);
    follower.offsets_m.push_back(place.offset_m);
    follower.alongs_m.push_back(place.along_m);
    follower.speeds_mps.push_back(std::max(0.0, state.speed_mps));
  }
  return follower;
}

// The way, driven as far as `follower` does instead of as far as predicted.
PredictedWay slowed(const PredictedWay& way, const std::vector<double>& predicted_m,
                    const Follower& follower) {
  PredictedWay slow{.probability = way.probability, .step_s = kStep_s};
  std::size_t index = 0;
  for (std::size_t step = 0; step < predicted_m.size(); ++step) {
    const double along = follower.alongs_m[step];
    while (index + 1 < predicted_m.size() && predicted_m[index + 1] < along) {
      ++index;
    }
    const double piece =
        index + 1 < predicted_m.size() ? predicted_m[index + 1] - predicted_m[index] : 0.0;
    const double share =
        piece > 1e-6 ? std::clamp((along - predicted_m[index]) / piece, 0.0, 1.0) : 0.0;
    const double time = kStep_s * (static_cast<double>(index) + share);
    PredictedState state = state_at(way, time);
    const PredictedState then = state_at(way, kStep_s * static_cast<double>(step));
    state.speed_mps = follower.speeds_mps[step];
    state.along_stddev_m = then.along_stddev_m;
    state.across_stddev_m = then.across_stddev_m;
    slow.states.push_back(state);
  }
  return slow;
}

}  // namespace

std::vector<TrafficObject> in_queues(const std::vector<TrafficObject>& objects, const Road& road,
                                     const Vehicle& vehicle, const std::vector<State>& ego,
                                     double horizon_s) {
  const auto steps = static_cast<std::size_t>(std::ceil(horizon_s / kStep_s));
  const Follower own = follower_of(vehicle, ego, road, steps);
  std::vector<Follower> ahead = {};  // Those already processed, with their new motion.
  std::vector<std::size_t> order = {};
  std::vector<Follower> first(objects.size());
  for (std::size_t index = 0; index < objects.size(); ++index) {
    if (!objects[index].ways.empty() && !objects[index].ways.front().states.empty()) {
      first[index] = follower_of(objects[index], objects[index].ways.front(), road, steps);
      first[index].object = index;
      order.push_back(index);
    }
  }
  std::sort(order.begin(), order.end(), [&](std::size_t one, std::size_t other) {
    const double one_m = first[one].alongs_m.front();
    const double other_m = first[other].alongs_m.front();
    return one_m != other_m ? one_m > other_m : one < other;
  });
  std::vector<TrafficObject> result = objects;
  for (const std::size_t index : order) {
    for (PredictedWay& way : result[index].ways) {
      const bool is_first = &way == &result[index].ways.front();
      Follower follower = is_first ? first[index] : follower_of(objects[index], way, road, steps);
      if (way.states.empty() || follower.offsets_m.front() == kTraffic.far_away_m) {
        continue;
      }
      const std::vector<double> predicted_m = follower.alongs_m;
      const bool is_behind_ego = own.alongs_m.front() > follower.alongs_m.front() &&
                                 std::abs(own.offsets_m.front() - follower.offsets_m.front()) <
                                     follower.half_width_m + own.half_width_m;
      for (const Follower& leader : ahead) {
        // No object is its own leader, whatever else it may do.
        if (leader.object == index ||
            leader.alongs_m.front() - follower.alongs_m.front() > kTraffic.queue_reach_m) {
          continue;
        }
        const bool is_ego_between = is_behind_ego && own.alongs_m.front() < leader.alongs_m.front();
        keep_behind(follower, leader, is_ego_between ? vehicle.length_m + kTraffic.room_m : 0.0);
      }
      if (is_behind_ego) {
        keep_behind(follower, own, 0.0, kTraffic.reaction_steps);
      }
      if (follower.alongs_m != predicted_m) {
        way = slowed(way, predicted_m, follower);
      }
      if (is_first) {
        ahead.push_back(std::move(follower));
      }
    }
  }
  return result;
}

PredictedState state_at(const PredictedWay& way, double time_s) {
  const double last = static_cast<double>(way.states.size() - 1);
  const double place = (time_s - way.first_s) / way.step_s;
  if (place <= 0.0) {
    return moved(way.states.front(), place * way.step_s);
  }
  if (place >= last) {
    return moved(way.states.back(), (place - last) * way.step_s);
  }
  const auto index = static_cast<std::size_t>(place);
  const double share = place - static_cast<double>(index);
  const PredictedState& from = way.states[index];
  const PredictedState& to = way.states[index + 1];
  return {.x_m = mix(from.x_m, to.x_m, share),
          .y_m = mix(from.y_m, to.y_m, share),
          .heading_rad =
              from.heading_rad +
              share * std::remainder(to.heading_rad - from.heading_rad, 2.0 * std::numbers::pi),
          .speed_mps = mix(from.speed_mps, to.speed_mps, share),
          .along_stddev_m = mix(from.along_stddev_m, to.along_stddev_m, share),
          .across_stddev_m = mix(from.across_stddev_m, to.across_stddev_m, share)};
}

Traffic::Traffic(const std::vector<TrafficObject>& objects, std::size_t steps) : at_(steps + 1) {
  for (std::size_t index = 0; index < objects.size(); ++index) {
    for (const PredictedWay& way : objects[index].ways) {
      if (way.states.empty() || way.probability < kTraffic.probability_min) {
        continue;
      }
      for (std::size_t step = 0; step <= steps; ++step) {
        const double time = kStep_s * static_cast<double>(step);
        at_[step].push_back(occupant(state_at(way, time), objects[index], way.probability));
        at_[step].back().object = index;
      }
    }
  }
}

}  // namespace motion_planning

#include "give_way.h"

#include <algorithm>
#include <cmath>

#include "common/scalar.h"
#include "motion_planning_tuning.h"
#include "trajectory.h"

namespace motion_planning {
namespace {

using ads::kInfinity;

// How the vehicle passes others.
struct Manner {
  double going_mps2 = 0.0;  // How it drives off.
  // If it passes first, it must have left so long before the other one arrives; if it passes
  // second, it arrives at least so long after the other one has left.
  double before_s = 0.0;
  double after_s = 0.0;
  double look_s = kInfinity;  // Others that come later do not count.
  // How far behind the line the place is at which they meet.
  double from_m = -kInfinity;
  double to_m = kInfinity;
};
constexpr Manner kAtALine{.going_mps2 = kYielding.at_line_going_mps2,
                          .before_s = kYielding.at_line_before_s,
                          .after_s = kYielding.at_line_after_s};
// Where there is no line, the vehicle itself is one: it is not in the way yet, and would be as soon
// as it drives off.
constexpr Manner kElsewhere{.going_mps2 = kYielding.elsewhere_going_mps2,
                            .before_s = kYielding.elsewhere_before_s,
                            .after_s = 0.0,
                            .look_s = kYielding.elsewhere_look_s,
                            .from_m = 0.0,
                            .to_m = kYielding.elsewhere_to_m};

constexpr double kRounding = 1e-9;

// The vehicle's position along the road at each step, without other traffic.
std::vector<double> free_drive(const Problem& problem, double along_m, double going_mps2) {
  const SpeedProfile profile(problem.road, problem.slow_stretches, std::nullopt, problem.start);
  std::vector<double> alongs = {along_m};
  double speed = std::max(0.0, problem.start.speed_mps);
  for (std::size_t step = 1; step <= problem.traffic.steps(); ++step) {
    const double allowed =
        std::min(std::max(problem.cruise_mps, problem.start.speed_mps),
                 profile.at(alongs.back(), kStep_s * static_cast<double>(step)).speed_mps);
    speed = std::clamp(speed + kStep_s * going_mps2, 0.0, std::max(0.0, allowed));
    alongs.push_back(alongs.back() + kStep_s * speed);
  }
  return alongs;
}

// Where and when another one is in the vehicle's way.
struct Passage {
  double begin_m = kInfinity;
  double end_m = -kInfinity;
  double comes_s = kInfinity;
  double leaves_s = -kInfinity;  // Or has begun to drive ahead on the same way.
};

Passage passage_of(const Problem& problem, const Traffic& traffic, std::size_t index,
                   double line_m) {
  Passage passage;
  for (std::size_t step = 0; step <= traffic.steps(); ++step) {
    const Occupant& other = traffic.at(step)[index];
    const RoadPlace place = problem.road.locate(other.x_m, other.y_m);
    const double angle = other.heading_rad - place.heading_rad;
    const double cosine = std::abs(std::cos(angle));
    const double sine = std::abs(std::sin(angle));
    const double half_along = other.half_length_m * cosine + other.half_width_m * sine;
    const double half_across = other.half_length_m * sine + other.half_width_m * cosine;
    const bool is_in_way = std::abs(place.offset_m) <
                               half_across + problem.vehicle.width_m / 2.0 + kYielding.beside_m &&
                           place.along_m + half_along > line_m &&
                           place.along_m - half_along < line_m + kYielding.crossing_m;
    if (!is_in_way) {
      if (std::isfinite(passage.comes_s)) {
        break;
      }
      continue;
    }
    const double time = kStep_s * static_cast<double>(step);
    passage.comes_s = std::min(passage.comes_s, time);
    passage.leaves_s = time;
    passage.begin_m = std::min(passage.begin_m, place.along_m - half_along);
    passage.end_m = std::max(passage.end_m, place.along_m + half_along);
    if (std::cos(angle) > kYielding.aligned) {
      break;  // From here on he leads.
    }
  }
  return passage;
}

// When the drive reaches a place; infinite if it does not.
double reached_s(const std::vector<double>& alongs_m, double along_m) {
  const auto first = std::ranges::lower_bound(alongs_m, along_m);
  return first == alongs_m.end() ? kInfinity
                                 : kStep_s * static_cast<double>(first - alongs_m.begin());
}

// The object with right of way behind the line that the vehicle would meet there.
std::optional<std::uint64_t> first_to_let_pass(const Problem& problem, const Traffic& traffic,
                                               const std::vector<TrafficObject>& objects,
                                               double along_m, double line_m,
                                               const Manner& manner) {
  const std::vector<double> drive = free_drive(problem, along_m, manner.going_mps2);
  const double half_length = problem.vehicle.length_m / 2.0;
  std::size_t object = 0;
  double met = 0.0;  // The probability of this object's ways that the vehicle would meet.
  for (std::size_t index = 0; index < traffic.at(0).size(); ++index) {
    const Occupant& now = traffic.at(0)[index];
    met = now.object == object ? met : 0.0;
    object = now.object;
    if (!objects[object].goes_first) {
      continue;
    }
    const Passage passage = passage_of(problem, traffic, index, line_m);
    const double arrives_s = reached_s(drive, passage.begin_m - half_length);
    const double gone_s = reached_s(drive, passage.end_m + half_length);
    const double behind_m = passage.begin_m - line_m;
    if (behind_m >= manner.from_m && behind_m <= manner.to_m && std::isfinite(passage.comes_s) &&
        passage.comes_s <= manner.look_s && gone_s > passage.comes_s - manner.before_s &&
        arrives_s < passage.leaves_s + manner.after_s) {
      met += now.probability;
    }
    if (met >= kProbabilityMin - kRounding) {
      return objects[object].id;
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<Halt> halt_before(const Problem& problem, const Traffic& traffic,
                                const std::vector<TrafficObject>& objects,
                                const std::vector<WaitingLine>& lines,
                                const std::optional<std::int64_t>& stood_at_lane) {
  const double half_length = problem.vehicle.length_m / 2.0;
  const double along = problem.road.locate(problem.start.x_m, problem.start.y_m).along_m;
  const double speed = std::max(0.0, problem.start.speed_mps);
  for (const WaitingLine& line : lines) {
    const double to_line = line.along_m - half_length - along;
    const double braking_way = to_line - kYielding.build_up_s * speed;
    const bool is_passed = to_line < -kYielding.over_m;
    const bool is_too_late =
        speed > kYielding.standing_mps &&
        speed * speed > 2.0 * kYielding.braking_max_mps2 * std::max(0.0, braking_way);
    if (is_passed || is_too_late) {
      continue;
    }
    Halt halt{.along_m = line.along_m - half_length - kBeforeLine_m, .line_m = line.along_m};
    halt.braking_mps2 =
        std::clamp(speed * speed / (2.0 * std::max(0.1, braking_way - kBeforeLine_m)),
                   SpeedProfile::kBraking_mps2, kYielding.braking_max_mps2);
    if (line.is_stop_sign && stood_at_lane != line.lane) {
      halt.kind = RuleKind::kStopLine;
      return halt;
    }
    if (const auto object =
            first_to_let_pass(problem, traffic, objects, along, line.along_m, kAtALine)) {
      halt.kind = RuleKind::kGiveWay;
      halt.object = *object;
      return halt;
    }
  }
  // Also without a line.
  if (speed < kYielding.pulling_out_mps) {
    const double front = along + half_length;
    if (const auto object =
            first_to_let_pass(problem, traffic, objects, along, front, kElsewhere)) {
      return Halt{.along_m = along,
                  .line_m = front,
                  .braking_mps2 = SpeedProfile::kBraking_mps2,
                  .kind = RuleKind::kGiveWay,
                  .object = *object,
                  .is_here = true};
    }
  }
  return std::nullopt;
}

std::optional<Halt> halt_before_end(const Problem& problem, double map_end_m) {
  const double along = problem.road.locate(problem.start.x_m, problem.start.y_m).along_m;
  const double halt_m = map_end_m - problem.vehicle.length_m / 2.0 - kBeforeLine_m;
  const double speed = std::max(0.0, problem.start.speed_mps);
  if (halt_m < along) {
    return std::nullopt;
  }
  return Halt{.along_m = halt_m,
              .line_m = map_end_m,
              .braking_mps2 = std::clamp(speed * speed / (2.0 * std::max(0.1, halt_m - along)),
                                         SpeedProfile::kBraking_mps2, kYielding.braking_max_mps2),
              .kind = RuleKind::kStopLine};
}

std::optional<std::int64_t> stood_at(const Road& road, const Vehicle& vehicle, const State& ego,
                                     const std::vector<WaitingLine>& lines,
                                     const std::optional<std::int64_t>& before) {
  const double front = road.locate(ego.x_m, ego.y_m).along_m + vehicle.length_m / 2.0;
  std::optional<std::int64_t> stood;
  for (const WaitingLine& line : lines) {
    const bool is_near =
        front > line.along_m - kYielding.near_m && front < line.along_m + kYielding.over_m;
    if (is_near && ego.speed_mps < kYielding.standing_mps) {
      return line.lane;
    }
    if (line.lane == before && front < line.along_m + kYielding.left_m) {
      stood = before;
    }
  }
  return stood;
}

}  // namespace motion_planning

#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "motion_planning_tuning.h"
#include "road.h"
#include "speed_profile.h"
#include "traffic.h"
#include "vehicle.h"

namespace motion_planning {

struct Interval {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};

/// A lane next to the road's line, to which the line may change only there.
struct GoalStretch {
  double begin_m = 0.0;  ///< Along the road.
  /// The lane's centre, to the left of the road's line, at each `Road::kStep_m`.
  std::vector<double> offsets_m = {0.0};

  [[nodiscard]] double middle_m() const {
    return begin_m + 0.5 * Road::kStep_m * static_cast<double>(offsets_m.size() - 1);
  }
  [[nodiscard]] double offset_m(double along_m) const {
    const double index = std::clamp((along_m - begin_m) / Road::kStep_m, 0.0,
                                    static_cast<double>(offsets_m.size() - 1));
    return offsets_m[static_cast<std::size_t>(index)];
  }
};

/// The state to reach. Times are seconds since the plan's start.
struct Goal {
  Pose centre = {};  ///< Of the rectangle that must contain the vehicle's centre.
  double half_length_m = 0.0;
  double half_width_m = 0.0;
  Interval heading_rad = {};
  Interval speed_mps = {};
  Interval time_s = {};
  /// Set if the goal is a stretch of the road instead of a rectangle: then length and width are
  /// along and across the road.
  std::optional<GoalStretch> on_road = {};

  /// The share of the length that is to stay free at both ends, so that the vehicle does not wait
  /// at the very end of a lane.
  double spare_share = kProblem.spare_share;

  /// The maximum distance of the vehicle before or behind the centre, with a margin.
  [[nodiscard]] double room_along_m() const {
    if (!on_road) {
      return kProblem.centre_share * half_length_m;
    }
    return std::max(kProblem.centre_share * half_length_m,
                    half_length_m - std::max(kProblem.spare_m, spare_share * half_length_m));
  }
};

/// The inputs of the optimization.
struct Problem {
  const Vehicle& vehicle;
  const Road& road;
  const Traffic& traffic;
  State start = {};
  const std::vector<Road>* lanes = nullptr;  ///< Ways along single lanes, for stops.
  std::optional<Goal> goal = {};
  std::vector<SlowStretch> slow_stretches = {};
  std::optional<Halt> halt = {};
  double cruise_mps = 10.0;         ///< The desired speed where the road has no limit.
  Interval cruise_within_mps = {};  ///< The bounds of the desired speed everywhere.
  bool is_emergency =
      false;  ///< Whether more than comfort's, the usual and the road's limits may be used.
  double goal_share = 1.0;  ///< Factor of the goal's weights in the optimization.
  double edge_share = 1.0;  ///< The same for the road's edges.
};

/// The permitted speed along the road of a problem.
inline SpeedProfile profile_of(const Problem& problem) {
  return {problem.road, problem.slow_stretches, problem.halt, problem.start};
}

/// The desired speed: the road's limit, if any, as far as the profile permits. Before a goal it is
/// not that of the goal; the goal costs more than any deviation from it.
inline double cruise_at(const Problem& problem, const SpeedProfile& profile, double along_m,
                        bool is_before_goal = false) {
  const double limit_mps = problem.road.speed_limit_mps(along_m);
  const double speed_mps = limit_mps > 0.0 ? limit_mps : problem.cruise_mps;
  if (is_before_goal) {
    return std::min(speed_mps, profile.wanted_mps(along_m));
  }
  return std::min(
      std::clamp(speed_mps, problem.cruise_within_mps.low, problem.cruise_within_mps.high),
      profile.wanted_mps(along_m));
}

/// The factor on the weight of a speed error: beyond `kFar_mps` the pull to the desired speed does
/// not increase further.
inline double cruise_share(double error_mps) {
  return std::min(1.0, kProblem.far_mps / std::max(1e-9, std::abs(error_mps)));
}

/// A way to drive: `inputs[k]` leads from `states[k]` to `states[k + 1]`, `kStep_s` later.
struct Way {
  std::vector<State> states = {};
  std::vector<Input> inputs = {};
  double cost = std::numeric_limits<double>::infinity();
};

}  // namespace motion_planning

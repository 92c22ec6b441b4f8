#pragma once

#include <cstddef>
#include <vector>

#include "motion_planning_tuning.h"
#include "problem.h"

namespace motion_planning {

/// States at equal time intervals.
struct Trajectory {
  double start_s = 0.0;
  double step_s = kStep_s / 2.0;
  std::vector<State> states = {};

  /// Interpolated between the states; the first or the last one beyond the ends. @pre  There are
  /// states.
  [[nodiscard]] State at(double time_s) const;
  [[nodiscard]] double duration_s() const {
    return step_s * static_cast<double>(states.empty() ? 0 : states.size() - 1);
  }
};

/// The way as a trajectory: the same motion, with half the time step. Where the way reverses, the
/// vehicle stands.
Trajectory trajectory_of(const Vehicle& vehicle, const Way& way, double start_s);

/// The evaluation of a trajectory against predictions.
struct Verdict {
  double smallest_gap_m = 0.0;  ///< To any way of any object; infinite without objects.
  double gap_s = 0.0;           ///< When that is, since the start.
  double hit_s = 0.0;           ///< When it first collides; infinite if it does not.
  /// The vehicle's speed then, relative to the other's along the vehicle's heading.
  double hit_mps = 0.0;
  std::size_t object = 0;  ///< The nearest object.
  double acceleration_min_mps2 = 0.0;
  double acceleration_max_mps2 = 0.0;
  double lateral_max_mps2 = 0.0;
};

/// The maximum distance by which the vehicle's body, by its corners and the middles of its sides,
/// is beyond a road edge in the first `until_s` of a trajectory; 0 if it is not.
double over_edge_m(const Vehicle& vehicle, const Trajectory& trajectory, const Road& road,
                   double until_s);

/// Less probable ways are considered only by their cost, unless those of one object that touch the
/// vehicle at the same time are more probable together.
inline constexpr double kProbabilityMin = kTrajectory.probability_min;

/// Evaluates the first `until_s` of a trajectory with exact boxes. Ignores objects for which
/// `is_ignored` is set, and ways less probable than `probability_min` as
/// described there.
Verdict judge(const Vehicle& vehicle, const Trajectory& trajectory, const Traffic& traffic,
              double until_s, const std::vector<bool>& is_ignored = {},
              double probability_min = kProbabilityMin);

}  // namespace motion_planning

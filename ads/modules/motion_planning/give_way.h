#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "motion_planning_tuning.h"
#include "problem.h"

namespace motion_planning {

/// A stop or yield line of the map across the lane that the road follows.
struct WaitingLine {
  std::int64_t lane = 0;
  double along_m = 0.0;       ///< Along the road.
  bool is_stop_sign = false;  ///< Stop at it in any case.

  friend bool operator==(const WaitingLine&, const WaitingLine&) = default;
};

/// The distance between the line and the front of the stopped vehicle.
inline constexpr double kBeforeLine_m = kYielding.before_line_m;

/// The first line before which the vehicle must stop: at a stop sign where it has not stopped yet,
/// or where it would conflict behind the line with an object that has right of way. A line that it
/// has passed, or before which it can no longer stop, is ignored. Without a line, a vehicle that
/// stands, or nearly so, does not pull out before such an object either.
///
/// Conflicts are found by predicting the vehicle with moderate acceleration up to the permitted
/// speed. It may pass before the other object if it has left the conflict area 1.5 s before that
/// arrives, and after it as soon as it has left.
///
/// `objects` are those of `traffic`; `stood_at_lane` is the lane of the line at which the vehicle
/// has stopped.
std::optional<Halt> halt_before(const Problem& problem, const Traffic& traffic,
                                const std::vector<TrafficObject>& objects,
                                const std::vector<WaitingLine>& lines,
                                const std::optional<std::int64_t>& stood_at_lane);

/// Stops before the end of the map; none if the vehicle cannot any more.
std::optional<Halt> halt_before_end(const Problem& problem, double map_end_m);

/// The lane of the line at which the vehicle last stopped, until it has passed it: the line at
/// which it stands now, else `before`.
std::optional<std::int64_t> stood_at(const Road& road, const Vehicle& vehicle, const State& ego,
                                     const std::vector<WaitingLine>& lines,
                                     const std::optional<std::int64_t>& before);

}  // namespace motion_planning

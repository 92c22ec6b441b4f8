#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "problem.h"

namespace motion_planning {

/// A line of the map across the lane that the road follows, to stop before.
struct WaitingLine {
  std::int64_t lane = 0;
  double along_m = 0.0;       ///< Of the road.
  bool is_stop_sign = false;  ///< To stop at in any case.

  friend bool operator==(const WaitingLine&, const WaitingLine&) = default;
};

/// How far before a line the vehicle's front comes to stand.
inline constexpr double kBeforeLine_m = 1.0;

/// The first line before which the vehicle has to stop: where a stop sign asks for it and it has
/// not stood there yet, and where someone goes first whom it would meet behind the line. A line
/// before which it can no longer stop, or which it has passed, is none.
///
/// Whom it would meet is told by a drive with moderate acceleration, as fast as is allowed. It may
/// pass before the other one if it is gone 1.5 s before he comes, and after him as soon as he is
/// gone.
///
/// `objects` are those of `traffic`; `stood_at_lane` is that of the line at which the vehicle has
/// stood.
std::optional<Halt> halt_before(const Problem& problem, const Traffic& traffic,
                                const std::vector<TrafficObject>& objects,
                                const std::vector<WaitingLine>& lines,
                                const std::optional<std::int64_t>& stood_at_lane);

/// The lane of the line at which the vehicle has stood last, until it has passed it: where it
/// stands now, else what it was.
std::optional<std::int64_t> stood_at(const Road& road, const Vehicle& vehicle, const State& ego,
                                     const std::vector<WaitingLine>& lines,
                                     const std::optional<std::int64_t>& before);

}  // namespace motion_planning

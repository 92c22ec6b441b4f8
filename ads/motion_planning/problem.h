#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "road.h"
#include "traffic.h"
#include "vehicle.h"

namespace motion_planning {

struct Interval {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};

/// The state to reach. Times are seconds since the plan's start.
struct Goal {
  Pose centre = {};  ///< Of the rectangle in which the vehicle's centre is to lie.
  double half_length_m = 0.0;
  double half_width_m = 0.0;
  Interval heading_rad = {};
  Interval speed_mps = {};
  Interval time_s = {};
};

/// A stretch of the road to be slow on.
struct SlowStretch {
  Interval along_m = {};
  double speed_mps = 0.0;
};

/// All that a trajectory is judged by.
struct Problem {
  const Vehicle& vehicle;
  const Road& road;
  const Traffic& traffic;
  State start = {};
  const std::vector<Road>* lanes = nullptr;  ///< Ways along single lanes; to stop on, see there.
  std::optional<Goal> goal = {};
  std::vector<SlowStretch> slow_stretches = {};
  double cruise_mps = 10.0;   ///< The speed to drive at where no goal asks for another.
  bool is_emergency = false;  ///< Whether more than comfort's and the usual limits may be used.
};

/// A way to drive: `inputs[k]` leads from `states[k]` to `states[k + 1]`, `Traffic::kStep_s` later.
struct Way {
  std::vector<State> states = {};
  std::vector<Input> inputs = {};
  double cost = std::numeric_limits<double>::infinity();
};

}  // namespace motion_planning

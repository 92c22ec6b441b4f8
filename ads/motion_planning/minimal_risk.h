#pragma once

#include <vector>

#include "trajectory.h"

namespace motion_planning {

/// A trajectory that stops, and how hard it brakes for that.
struct Stop {
  Trajectory trajectory = {};
  double braking_mps2 = 0.0;
  double hit_s = 0.0;  ///< When it touches something, since its start; infinite if it does not.
};

/// Stops on the line that `along` drives, by the mildest braking that is safe.
///
/// Each braking is tried from the present speed and acceleration. It is judged first by whom the
/// vehicle runs into, how soon and how fast, then by who behind it could not brake in time, if that
/// driver begins a second later and brakes by no more than 5 m/s^2, then by comfort.
Stop stop_along(const Problem& problem, const Trajectory& along);

}  // namespace motion_planning

#pragma once

#include <vector>

#include "trajectory.h"

namespace motion_planning {

/// A trajectory that stops, and how hard it brakes for that.
struct Stop {
  Trajectory trajectory = {};
  double braking_mps2 = 0.0;
  double hit_s = 0.0;  ///< When it touches something, since its start; infinite if it does not.
  double price = 0.0;  ///< By which stops are compared.
};

/// Stops on the line that `along` drives, by the mildest braking that is safe.
///
/// Each braking is tried from the present speed and acceleration. It is judged first by whom the
/// vehicle runs into, how soon and how fast, then by who behind it could not brake in time, if that
/// driver begins a second later and brakes by no more than 5 m/s^2, then by who would run
/// into it if he did not react to it at all, as in `unyielding`, then by comfort.
/// Where the vehicle stays in its lane, those are left out who drive into that lane from behind.
Stop stop_along(const Problem& problem, const Traffic& unyielding, const Trajectory& along,
                bool stays_in_lane = false);

/// The best stop: along `nominal`, or on one of the problem's lanes, up to two beside the
/// vehicle's.
Stop safest_stop(const Problem& problem, const Traffic& unyielding, const Trajectory& nominal);

}  // namespace motion_planning

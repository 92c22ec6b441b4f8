#pragma once

#include <cstdint>
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

/// What the line is that a stop is made on.
enum class StopLine : std::uint8_t { kPlan, kOwnLane, kOtherLane };

/// Stops on the line that `along` drives, by the mildest braking that is safe.
///
/// Each braking is tried from the present speed and acceleration. It is judged first by whom the
/// vehicle runs into, how soon and how fast, then by who behind it could not brake in time, if that
/// driver begins a second later and brakes by no more than 5 m/s^2, then by who would run
/// into it if he did not react to it at all, as in `unyielding`, then by comfort.
/// In the vehicle's own lane those are left out who drive into it from behind. On the way into
/// another one it may also drive on for a while before it brakes.
Stop stop_along(const Problem& problem, const Traffic& unyielding, const Trajectory& along,
                StopLine line = StopLine::kPlan);

/// The best stop: along `nominal`, or on one of the problem's lanes, up to two beside the
/// vehicle's.
Stop safest_stop(const Problem& problem, const Traffic& unyielding, const Trajectory& nominal);

}  // namespace motion_planning

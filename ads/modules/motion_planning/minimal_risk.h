#pragma once

#include <cstdint>
#include <vector>

#include "trajectory.h"

namespace motion_planning {

/// A trajectory that stops, and its braking.
struct Stop {
  Trajectory trajectory = {};
  double braking_mps2 = 0.0;
  double hit_s = 0.0;  ///< When it first collides, since its start; infinite if it does not.
  double price = 0.0;  ///< The cost by which stops are compared.
};

/// The line along which a stop is made.
enum class StopLine : std::uint8_t { kPlan, kOwnLane, kOtherLane };

/// Stops along the line of `along`, with the mildest safe braking.
///
/// Each braking is simulated from the present speed and acceleration. Stops are ranked first by the
/// vehicle's own collisions, how soon and how fast, then by objects behind that could not brake in
/// time if their driver reacts after a second and brakes by at most 5 m/s^2, then by objects that
/// would collide with it without any reaction, as in `unyielding`, then by comfort. In the
/// vehicle's own lane, objects that drive into it from behind are ignored.
/// On the way into another one it may also drive on for a while before it brakes.
Stop stop_along(const Problem& problem, const Traffic& unyielding, const Trajectory& along,
                StopLine line = StopLine::kPlan);

/// The best stop: along `nominal`, or on one of the problem's lanes, up to two beside the
/// vehicle's.
Stop safest_stop(const Problem& problem, const Traffic& unyielding, const Trajectory& nominal);

}  // namespace motion_planning

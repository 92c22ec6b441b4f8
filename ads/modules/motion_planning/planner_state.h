#pragma once

#include "planner.h"
#include "planning/planner_state.pb.h"

namespace motion_planning {

/// Converts the planner's state to an empty message, and back.

void write(const Planner::Memory& memory, planning::PlannerState& message);
/// @throws std::invalid_argument  The message is not a valid state.
Planner::Memory read(const planning::PlannerState& message);

}  // namespace motion_planning

#pragma once

#include "planner.h"
#include "planning/planner_state.pb.h"

namespace motion_planning {

/// From what the planner remembers to a message that says nothing of it yet, and back.

void write(const Planner::Memory& memory, planning::PlannerState& message);
/// @throws std::invalid_argument  No planner remembers this.
Planner::Memory read(const planning::PlannerState& message);

}  // namespace motion_planning

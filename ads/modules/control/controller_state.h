#pragma once

#include "control/controller_state.pb.h"
#include "tracker.h"

namespace ads {

/// Converts the controller's state to messages, which must be empty, and back.

void write(const Path& path, control::Path& message);
/// @throws std::invalid_argument  The path cannot be followed.
Path read(const control::Path& message);

/// Without acceleration and steering.
void write(const Motion& place, control::Place& message);
Motion read(const control::Place& message);

void write(const Tracker::Memory& memory, control::TrackerMemory& message);
Tracker::Memory read(const control::TrackerMemory& message);

}  // namespace ads

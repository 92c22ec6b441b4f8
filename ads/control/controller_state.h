#pragma once

#include "control/controller_state.pb.h"
#include "tracker.h"

namespace ads {

/// From what the controller remembers to messages, which are empty, and back.

void write(const Path& path, control::Path& message);
/// @throws std::invalid_argument  It is none that can be followed.
Path read(const control::Path& message);

void write(const Tracker::Memory& memory, control::TrackerMemory& message);
Tracker::Memory read(const control::TrackerMemory& message);

}  // namespace ads

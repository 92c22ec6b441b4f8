#pragma once

#include <chrono>

namespace fastcycle::inspect {

/// How long to wait until the next look at a topic: at least about `period`, and so that it falls
/// into the pause behind a message.
///
/// Looking, and all the tools that read what it gives, takes a CPU for a moment. Right behind a
/// message its subscribers wait for one; in the pause nobody does. A topic without a pause, or
/// without a rhythm, is looked at each `period`.
///
/// @param interval  Between the last two messages.
/// @param age  Of the last one, now.
std::chrono::nanoseconds wait_for_pause(std::chrono::nanoseconds interval,
                                        std::chrono::nanoseconds age,
                                        std::chrono::nanoseconds period) noexcept;

}  // namespace fastcycle::inspect

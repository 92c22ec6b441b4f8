#pragma once

#include <chrono>

namespace fastcycle::inspect {

/// Time to wait before a topic is read again: at least about `period`, and such that the read falls
/// into the pause after a message.
///
/// Reading a topic, and all the tools that process the result, takes a CPU for a moment. Just after
/// a message its subscribers need that CPU; in the pause they do not. A topic without a pause, or
/// without a regular rate, is read every `period`.
///
/// @param interval  Between the last two messages.
/// @param age  Of the last message, now.
std::chrono::nanoseconds wait_for_pause(std::chrono::nanoseconds interval,
                                        std::chrono::nanoseconds age,
                                        std::chrono::nanoseconds period) noexcept;

}  // namespace fastcycle::inspect

#pragma once

#include <cstdint>

#include "measure/floors.h"

namespace fastcycle::measure {

/// What one writes first: each message's payload comes from malloc and goes back to free, and a
/// queue with mutex and condition variable leads to the receiver. Large payloads are new pages each
/// time.
[[nodiscard]] Measured floor_malloc(const Plan& plan);

/// How long a flood flows before it is counted: two threads begin on one CPU, where they take turns
/// without ever meeting, until the kernel moves one of them.
constexpr std::int64_t kRunInMs = 300;

/// What a flood came to.
struct Flood {
  std::int64_t run_in = 0;  ///< Messages before those that count.
  std::int64_t sent = 0;
  std::int64_t received = 0;
  std::int64_t damaged = 0;
  std::int64_t first_sent_ns = 0;
  std::int64_t last_received_ns = 0;
  Usage usage;
};

/// As many messages a second as a std::mutex, a std::deque of pointers and a condition variable let
/// through: recycled messages, at most `window` of them under way, and a sender that gets
/// `window / 4` back at a time. The receiver is notified only while it waits.
[[nodiscard]] Flood floor_flood(const Plan& plan, std::int64_t window,
                                std::int64_t run_in_ms = kRunInMs);

}  // namespace fastcycle::measure

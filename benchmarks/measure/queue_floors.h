#pragma once

#include <cstdint>

#include "measure/floors.h"

namespace fastcycle::measure {

/// The obvious implementation: each message's payload is allocated by malloc and released by free,
/// and passed to the receiver by a queue with mutex and condition variable. Large payloads are new
/// pages each time.
[[nodiscard]] Measured floor_malloc(const Plan& plan);

/// How long a flood runs before it is counted: two threads start on one CPU, where they alternate
/// without contention until the kernel moves one of them.
constexpr std::int64_t kRunInMs = 300;

/// The result of a flood.
struct Flood {
  std::int64_t run_in = 0;  ///< Messages before the counted ones.
  std::int64_t sent = 0;
  std::int64_t received = 0;
  std::int64_t damaged = 0;
  std::int64_t first_sent_ns = 0;
  std::int64_t last_received_ns = 0;
  Usage usage;
};

/// The throughput of a std::mutex, a std::deque of pointers and a condition variable: recycled
/// messages, at most `window` of them in flight, and a sender that gets `window / 4` back at a
/// time. The receiver is notified only while it waits.
[[nodiscard]] Flood floor_flood(const Plan& plan, std::int64_t window,
                                std::int64_t run_in_ms = kRunInMs);

/// The same through a bare ring between two threads that spin.
[[nodiscard]] Flood floor_ring_flood(const Plan& plan, std::int64_t window,
                                     std::int64_t run_in_ms = kRunInMs);

}  // namespace fastcycle::measure

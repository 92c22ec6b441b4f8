#pragma once

#include <chrono>
#include <cstdint>
#include <thread>

#include "base/clock.h"

namespace fastcycle::host {

/// Polls `condition` every 200 µs until it holds, at most until `deadline_ns` of CLOCK_MONOTONIC:
/// for the end of a run, and for waits of simulated time.
template <typename Condition>
bool wait_until(std::int64_t deadline_ns, const Condition& condition) {
  while (!condition()) {
    if (base::monotonic_ns() >= deadline_ns) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  return true;
}

}  // namespace fastcycle::host

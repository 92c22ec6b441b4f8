#pragma once

#include <chrono>
#include <cstdint>
#include <thread>

#include "base/clock.h"

namespace fastcycle::host {

/// For the end of a run, when nothing is driven any more, and for what simulated time waits for:
/// looks every 200 µs whether `condition` holds, until `deadline_ns` of CLOCK_MONOTONIC.
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

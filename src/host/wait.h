#pragma once

#include <chrono>
#include <thread>

#include "base/clock.h"

namespace fastcycle::host {

/// For the end of a run, when nothing is driven any more: looks every 200 µs whether `condition`
/// holds, for at most `limit`.
template <typename Condition>
void wait_up_to(std::chrono::nanoseconds limit, const Condition& condition) {
  const std::int64_t limit_ns = base::monotonic_ns() + limit.count();
  while (!condition() && base::monotonic_ns() < limit_ns) {
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
}

}  // namespace fastcycle::host

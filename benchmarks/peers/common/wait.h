#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

#include "measure/clock.h"

namespace fastcycle::peers {

/// Looks every millisecond whether `condition()` holds, as writers and readers have to find each
/// other before a run.
///
/// @errors  std::runtime_error with `what` was waited for if it does not within ten seconds.
template <typename Condition>
void wait_until(const std::string& what, const Condition& condition) {
  constexpr std::int64_t kTimeoutNs = 10'000'000'000;
  constexpr std::int64_t kPauseNs = 1'000'000;
  const std::int64_t deadline_ns = measure::now_ns() + kTimeoutNs;
  while (!condition()) {
    if (measure::now_ns() > deadline_ns) {
      throw std::runtime_error("waited in vain until " + what);
    }
    measure::sleep_until(measure::now_ns() + kPauseNs);
  }
}

}  // namespace fastcycle::peers

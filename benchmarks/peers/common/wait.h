#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

#include "measure/clock.h"

namespace fastcycle::peers {

/// Polls `condition()` every millisecond until it holds, for writers and readers to discover each
/// other before a run.
///
/// @errors  std::runtime_error that contains `what` if it does not hold within ten seconds.
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

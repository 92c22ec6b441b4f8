#pragma once

#include <chrono>
#include <cstdint>

#include "base/clock.h"
#include "base/sleepers.h"

namespace fastcycle::host {

/// Event on which the control thread sleeps; a thread that may have made its condition true calls
/// `ring`.
///
/// @threads  `ring` is Safe; `wait` is confined to the control thread.
/// @realtime `ring` takes no lock and allocates nothing; one system call if the control thread
///           sleeps.
class Bell {
 public:
  /// Called after the change that makes the condition true.
  void ring() noexcept { sleepers_.wake(0); }

  /// Waits until `condition` holds, and evaluates it after each ring. False if it does not at
  /// `deadline_ns` of CLOCK_MONOTONIC (`base::kNever`: no limit).
  template <typename Condition>
  bool wait(std::int64_t deadline_ns, const Condition& condition) {
    while (!condition()) {
      sleepers_.announce(0);
      if (condition()) {
        sleepers_.withdraw(0);
        return true;
      }
      if (!sleepers_.sleep(0, deadline_ns)) {
        return condition();
      }
    }
    return true;
  }

 private:
  base::Sleepers sleepers_;
};

/// CLOCK_MONOTONIC in `span`, but not later than `latest_ns`.
[[nodiscard]] inline std::int64_t deadline_in(std::chrono::nanoseconds span,
                                              std::int64_t latest_ns = base::kNever) {
  const std::int64_t now_ns = base::monotonic_ns();
  return span.count() >= latest_ns - now_ns ? latest_ns : now_ns + span.count();
}

}  // namespace fastcycle::host

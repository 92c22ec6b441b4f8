#pragma once

#include <atomic>
#include <cstdint>

#include "base/clock.h"

namespace fastcycle::detail {

/// Notified when a component's next timer changes.
class TimerWatch {
 public:
  TimerWatch() = default;
  TimerWatch(const TimerWatch&) = delete;
  TimerWatch& operator=(const TimerWatch&) = delete;
  virtual ~TimerWatch() = default;

  /// A timer of some component is due at `due_ns`: CLOCK_MONOTONIC when live, else simulated time.
  virtual void timer_armed(std::int64_t due_ns) noexcept = 0;
};

/// When the next timer of one component is due, for the watch of all timers.
///
/// @threads  `set` by the worker that serves the component; all else is Safe.
class DueTime {
 public:
  DueTime() = default;
  DueTime(const DueTime&) = delete;
  DueTime& operator=(const DueTime&) = delete;

  /// As for `TimerWatch`; `base::kNever` without one.
  [[nodiscard]] std::int64_t get() const noexcept {
    return due_ns_.load(std::memory_order_seq_cst);
  }
  /// Takes it, if it is `due_ns`: true once for each time that it was set.
  bool take(std::int64_t due_ns) noexcept {
    return due_ns_.compare_exchange_strong(due_ns, base::kNever, std::memory_order_seq_cst);
  }
  /// Sets it; notifies `watch` if it changed to a time.
  void set(std::int64_t due_ns, TimerWatch* watch) noexcept {
    if (due_ns != get()) {
      due_ns_.store(due_ns, std::memory_order_seq_cst);
      if (due_ns != base::kNever) {
        watch->timer_armed(due_ns);
      }
    }
  }

 private:
  std::atomic<std::int64_t> due_ns_{base::kNever};
};

}  // namespace fastcycle::detail

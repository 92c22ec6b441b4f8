#pragma once

#include <cstdint>

#include "fastcycle/time.h"

namespace fastcycle {

/// When a periodic timer is due: at `start + phase + k * period`, k = 1, 2, …, where `start` is the
/// time at which the application's timers started, the same for all of them.
struct TimerOptions {
  Duration period{};  ///< Above zero.
  /// Offset to the application's start of timers.
  Duration phase{};
};

/// One call of a timer's callback.
struct Tick {
  Time due{};                 ///< When it should have been called.
  std::uint64_t skipped = 0;  ///< Ticks skipped before this one because they were late.
};

namespace detail {
class TimerCore;
void arm_timer(TimerCore& timer, Time due) noexcept;
void arm_timer_in(TimerCore& timer, Duration delay) noexcept;
void reset_timer(TimerCore& timer) noexcept;
void cancel_timer(TimerCore& timer) noexcept;
}  // namespace detail

/// Calls back at absolute times: no drift, however long the callbacks take.
///
/// A tick that is a whole period late replaces the missed ones, which are counted as overruns; at
/// most one tick of a timer waits.
///
/// @threads  Confined to its component's activations: a call elsewhere ends the process with a
///           message. The component's constructor and destructor may cancel.
/// @realtime No allocation, no lock.
class Timer {
 public:
  /// Constructed by `Context::create_timer`.
  explicit Timer(detail::TimerCore& core) : core_(&core) {}

  /// Calls back once at `due`, or as soon as possible if that is past; replaces an earlier
  /// `arm_at`.
  ///
  /// @pre  The timer has no period.
  void arm_at(Time due) { detail::arm_timer(*core_, due); }

  /// Calls back once, when `delay` has passed since the time of this activation; else as `arm_at`.
  void arm_in(Duration delay) { detail::arm_timer_in(*core_, delay); }

  /// Restarts the period: the next tick is due one period after the time of this activation, and
  /// each further one a period later. A cancelled timer ticks again.
  ///
  /// @pre  The timer has a period.
  void reset() { detail::reset_timer(*core_); }

  /// No further callback until the next `arm_at` or `reset`.
  void cancel() { detail::cancel_timer(*core_); }

 private:
  detail::TimerCore* core_;
};

}  // namespace fastcycle

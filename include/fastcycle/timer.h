#pragma once

#include <cstdint>

#include "fastcycle/time.h"

namespace fastcycle {

/// When a periodic timer is due: at `start + phase + k * period`, k = 1, 2, …, where `start` is the
/// time at which the application's timers started, the same for all of them.
struct TimerOptions {
  Duration period{};  ///< Above zero.
  /// How much later than the others it begins.
  Duration phase{};
};

/// One call of a timer's callback.
struct Tick {
  Time due{};  ///< When it should have been called.
  std::uint64_t skipped =
      0;  ///< Ticks before this one that were skipped, since they came too late.
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
/// A tick that comes a whole period late replaces those that it missed, and they are counted as
/// overruns; at most one tick of a timer waits.
///
/// @threads  Confined to its component's activations: who calls it elsewhere is told, and the
///           process ends. Its constructor and destructor may cancel.
/// @realtime No allocation, no lock.
class Timer {
 public:
  /// Made by `Context::create_timer`.
  explicit Timer(detail::TimerCore& core) : core_(&core) {}

  /// Calls back once at `due`, or as soon as possible if that is past; replaces an earlier
  /// `arm_at`.
  ///
  /// @pre  The timer has no period.
  void arm_at(Time due) { detail::arm_timer(*core_, due); }

  /// Calls back once, when `delay` has passed since the time of this activation; else as `arm_at`.
  void arm_in(Duration delay) { detail::arm_timer_in(*core_, delay); }

  /// The period begins anew: the next tick is due one period after the time of this activation, and
  /// each of the others one period later. One that was cancelled ticks again.
  ///
  /// @pre  The timer has a period.
  void reset() { detail::reset_timer(*core_); }

  /// No callback comes until the next `arm_at` or `reset`.
  void cancel() { detail::cancel_timer(*core_); }

 private:
  detail::TimerCore* core_;
};

}  // namespace fastcycle

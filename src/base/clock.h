#pragma once

#include <atomic>
#include <cstdint>

#include "fastcycle/time.h"

namespace fastcycle::base {

/// Nanoseconds of CLOCK_MONOTONIC.
[[nodiscard]] std::int64_t monotonic_ns() noexcept;

/// No deadline: later than anything.
inline constexpr std::int64_t kNever = INT64_MAX;

/// The application's clock: the source of all times in an application.
///
/// Live, it is CLOCK_MONOTONIC plus an offset to Unix time that is fixed when it is created, so
/// that it never steps; at a rate other than 1 it runs that many times as fast. Simulated, it is
/// stopped until the scheduler sets it.
///
/// @threads  Safe; `set_simulated` is for the scheduler alone.
/// @realtime One clock read, no lock.
class Clock {
 public:
  /// @pre  `rate > 0`
  static Clock live(double rate = 1.0);
  static Clock simulated(Time start = kSimulatedStart);

  Clock(const Clock& other) noexcept;
  Clock& operator=(const Clock&) = delete;

  [[nodiscard]] bool is_simulated() const noexcept { return is_simulated_; }
  [[nodiscard]] double rate() const noexcept { return rate_; }

  [[nodiscard]] Time now() const noexcept;

  /// The time of a live clock when CLOCK_MONOTONIC is `monotonic`; the present time of a simulated
  /// one.
  [[nodiscard]] Time at_monotonic(std::int64_t monotonic) const noexcept;

  /// The CLOCK_MONOTONIC nanoseconds at which a live clock will show `time`; of a stopped one, if
  /// it resumed now.
  [[nodiscard]] std::int64_t monotonic_at(Time time) const noexcept;

  /// @pre  The clock is simulated, and `time` is not before `now()`.
  void set_simulated(Time time) noexcept;

  /// Sets it to `time` now. Before it is read.
  void restart(Time time) noexcept;

  /// Stops a live clock at `time`, until `go_on_at`. Before it is read.
  void stand_at(Time time) noexcept;
  [[nodiscard]] bool stands() const noexcept;
  /// Resumes a stopped clock, as if at the time when CLOCK_MONOTONIC was `monotonic`.
  ///
  /// @threads  One; others may read it meanwhile.
  void go_on_at(std::int64_t monotonic) noexcept;

 private:
  Clock(bool is_simulated, double rate, std::int64_t origin_ns, std::int64_t monotonic_origin_ns);

  const bool is_simulated_;
  const double rate_;
  std::int64_t origin_ns_;
  std::atomic<std::int64_t> monotonic_origin_ns_;  ///< `kNever` while a live clock is stopped.
  std::atomic<std::int64_t> simulated_ns_;
};

/// `time` as nanoseconds since 1970, for atomics and files.
[[nodiscard]] constexpr std::int64_t to_ns(Time time) noexcept {
  return time.time_since_epoch().count();
}
[[nodiscard]] constexpr Time from_ns(std::int64_t ns) noexcept {
  return Time(Duration(ns));
}

}  // namespace fastcycle::base

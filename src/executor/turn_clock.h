#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "base/clock.h"

namespace fastcycle::detail {

/// The time of one component's turn: the clock is read when an activation ends, and then the next
/// one begins.
///
/// @threads  Confined to the worker that serves the component.
class TurnClock {
 public:
  explicit TurnClock(const base::Clock& clock) : clock_(clock) {}

  void read() noexcept { read_ns_ = base::monotonic_ns(); }
  void set(std::int64_t monotonic_ns) noexcept { read_ns_ = monotonic_ns; }
  /// Advances it to `time` at least, which may be later than the last reading. Live only.
  void pass(Time time) noexcept { read_ns_ = std::max(read_ns_, clock_.monotonic_at(time)); }

  /// Until `let_go` it is `time` on the application's clock: another component's, which is
  /// followed.
  void hold(Time time) noexcept { held_ = time; }
  void let_go() noexcept { held_.reset(); }

  /// As it was read last, CLOCK_MONOTONIC.
  [[nodiscard]] std::int64_t read_ns() const noexcept { return read_ns_; }
  /// The same on the application's clock.
  [[nodiscard]] Time now() const noexcept { return held_ ? *held_ : clock_.at_monotonic(read_ns_); }
  [[nodiscard]] std::int64_t now_ns() const noexcept { return base::to_ns(now()); }

 private:
  const base::Clock& clock_;
  std::int64_t read_ns_ = 0;
  std::optional<Time> held_;
};

}  // namespace fastcycle::detail

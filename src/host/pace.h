#pragma once

#include <cstdint>
#include <functional>
#include <mutex>

#include "executor/simulation.h"
#include "fastcycle/time.h"

namespace fastcycle::host {

/// Couples simulated time to wall time, at a rate, with pauses: owns rate and pause.
///
/// @threads  Safe.
class WallPace final : public detail::Pace {
 public:
  /// @pre  `rate > 0`
  explicit WallPace(double rate) : rate_(rate) {}

  /// Called after each change; set before the start.
  std::function<void()> on_change = [] {};

  /// Simulated time is `time` now.
  void begin(Time time);

  void set_paused(bool is_paused);
  [[nodiscard]] bool is_paused() const;
  void set_rate(double rate);
  [[nodiscard]] double rate() const;
  /// Pauses, and advances time to the next input.
  void step();

  [[nodiscard]] std::int64_t may_go_at(Time next) noexcept override;
  void goes(Time next, bool is_fed) noexcept override;

 private:
  [[nodiscard]] Time position(std::int64_t wall_ns) const noexcept;
  void move_anchor();

  mutable std::mutex mutex_;
  double rate_;
  bool is_paused_ = false;
  int steps_ = 0;  ///< Pending steps.
  // At `anchor_ns_` of CLOCK_MONOTONIC it was `anchor_`; while paused it is `anchor_`.
  std::int64_t anchor_ns_ = 0;
  Time anchor_{};
};

}  // namespace fastcycle::host

#pragma once

#include <cstdint>
#include <functional>
#include <mutex>

#include "executor/simulation.h"
#include "fastcycle/time.h"

namespace fastcycle::host {

/// Lets simulated time go as time on the wall does, faster or slower, and stand when it is told to:
/// owns rate and pause.
///
/// @threads  Safe.
class WallPace final : public detail::Pace {
 public:
  /// @pre  `rate > 0`
  explicit WallPace(double rate) : rate_(rate) {}

  /// Called after each change; set before the start.
  std::function<void()> on_change = [] {};

  /// Simulated time shows `time` now.
  void begin(Time time);

  void set_paused(bool is_paused);
  [[nodiscard]] bool is_paused() const;
  void set_rate(double rate);
  [[nodiscard]] double rate() const;
  /// Pauses, and lets time go to the next moment for which there is input.
  void step();

  [[nodiscard]] std::int64_t may_go_at(Time next) noexcept override;
  void goes(Time next, bool is_fed) noexcept override;

 private:
  [[nodiscard]] Time position(std::int64_t wall_ns) const noexcept;
  void move_anchor();

  mutable std::mutex mutex_;
  double rate_;
  bool is_paused_ = false;
  int steps_ = 0;  ///< That are still to be made.
  // At `anchor_ns_` of CLOCK_MONOTONIC it was `anchor_`; while paused it is `anchor_`.
  std::int64_t anchor_ns_ = 0;
  Time anchor_{};
};

}  // namespace fastcycle::host

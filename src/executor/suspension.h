#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>

#include "base/clock.h"
#include "broker/inbox.h"

namespace fastcycle::detail {

/// The gate of one component's life cycle: whether messages and timers are served, what is dropped
/// while they are not, and the alarm that may end that.
///
/// @threads  `is_open`, `is_suspended`, `is_closed` are Safe; all else is confined to the worker
///           that serves the component, and to the control thread before the start and after the
///           end.
class Suspension {
 public:
  /// Called with the credit of a message that was dropped.
  using GiveBack = std::function<void(std::shared_ptr<LaneCredit>)>;

  Suspension(Inbox& inbox, GiveBack give_back) : inbox_(inbox), give_back_(std::move(give_back)) {}
  Suspension(const Suspension&) = delete;
  Suspension& operator=(const Suspension&) = delete;

  /// Starts to serve messages and timers.
  void open() noexcept { gate_.store(Gate::kOpen, std::memory_order_relaxed); }
  /// Stops that; waiting messages are checked in a turn: this one or the next.
  void suspend() noexcept;
  /// The same, but all messages until `resume` keep waiting.
  void suspend_keeping() noexcept;
  /// Drops messages received until now, unless they are kept, and opens.
  void resume() noexcept;

  [[nodiscard]] bool is_open() const noexcept { return gate() == Gate::kOpen; }
  [[nodiscard]] bool is_suspended() const noexcept { return gate() == Gate::kSuspended; }
  /// Whether it was never opened.
  [[nodiscard]] bool is_closed() const noexcept { return gate() == Gate::kClosed; }

  /// Drops, as inactive, messages that wait for callbacks, except those that outlive a suspension:
  /// all but the last messages of latched topics, or these too (`with_latched`). While all messages
  /// are kept, drops them only with `with_latched`.
  void drop_waiting(bool with_latched) noexcept;

  void set_alarm(Time due, std::function<void()> action);
  void cancel_alarm() noexcept { alarm_ns_ = base::kNever; }
  /// When the alarm is due, on the application's clock; `base::kNever` without one.
  [[nodiscard]] std::int64_t alarm_ns() const noexcept { return alarm_ns_; }
  [[nodiscard]] bool has_alarm() const noexcept { return alarm_ns_ != base::kNever; }
  /// Returns the action of the alarm, and clears it.
  [[nodiscard]] std::function<void()> take_alarm() noexcept;

  /// While suspended: timers may be armed, since it is resumed next.
  bool is_resuming = false;

 private:
  enum class Gate : std::uint8_t { kClosed, kOpen, kSuspended };
  [[nodiscard]] Gate gate() const noexcept { return gate_.load(std::memory_order_relaxed); }

  bool is_keeping_ = false;
  Inbox& inbox_;
  const GiveBack give_back_;
  /// Written by the worker, read by threads that wait for the end.
  std::atomic<Gate> gate_{Gate::kClosed};
  std::int64_t alarm_ns_ = base::kNever;
  std::function<void()> alarm_;
};

}  // namespace fastcycle::detail

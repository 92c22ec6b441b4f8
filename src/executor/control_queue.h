#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>

#include "base/clock.h"
#include "base/priority_mutex.h"
#include "executor/activation_ring.h"

namespace fastcycle::detail {

/// Work of a component between two messages: connections, life cycle, parameters, completed jobs,
/// replies to itself.
struct Control {
  /// The key of an event without a timer.
  static constexpr std::uint64_t kNoTimer = ~std::uint64_t{0};

  Cause cause{};
  std::function<void()> body;
  std::function<void()> finished = {};  ///< After the activation, its fault included.
  std::int64_t posted_ns = 0;           ///< When, on the application's clock.
  std::uint64_t key = 0;                ///< Identifies it among others of its cause, in a log.
};

/// The waiting control causes of one component.
///
/// Those that others post are served before all messages: they affect every message that is
/// published after `post` returned. Those that a component posts to itself are served in the order
/// of their times among its messages and ticks, so that a component which keeps posting does not
/// starve them.
///
/// Posts of others are bounded by their sources: each connection, transaction, mode switch, job and
/// call waits once. A component's posts to itself are bounded here.
///
/// @threads  `post` and `has_posted` are Safe; all else is confined to the worker that serves the
///           component.
class ControlQueue {
 public:
  /// Limit of those that a component posts to itself.
  static constexpr std::size_t kMaxOwn = 4096;

  ControlQueue() = default;
  ControlQueue(const ControlQueue&) = delete;
  ControlQueue& operator=(const ControlQueue&) = delete;

  void post(Control control);
  /// False if too many wait.
  [[nodiscard]] bool post_own(Control control);

  /// Whether a cause that others posted waits. True before a message published after `post`
  /// returned can be seen.
  [[nodiscard]] bool has_posted() const noexcept {
    return count_.load(std::memory_order_seq_cst) != 0;
  }
  /// Takes the next cause that others posted; false if there is none.
  [[nodiscard]] bool take_posted(Control& control);
  /// Whether one of this cause and key waits.
  [[nodiscard]] bool has_posted(Cause cause, std::uint64_t key);
  /// Takes the next of this cause and key, at any position; false if there is none.
  [[nodiscard]] bool take_posted(Cause cause, std::uint64_t key, Control& control);

  [[nodiscard]] bool has_own() const noexcept { return !own_.empty(); }
  /// When the next of its own was posted. @pre  `has_own()`.
  [[nodiscard]] std::int64_t next_own_ns() const noexcept { return own_.front().posted_ns; }
  [[nodiscard]] Control take_own();

 private:
  /// @pre The mutex is held.
  [[nodiscard]] std::deque<Control>::iterator find(Cause cause, std::uint64_t key);

  std::deque<Control> own_;

  // Locked only when a control cause is posted or served.
  base::PriorityMutex mutex_;
  std::deque<Control> posted_;
  /// Written under the mutex. Set before what is published after `post` returned.
  alignas(64) std::atomic<std::size_t> count_{0};
};

}  // namespace fastcycle::detail

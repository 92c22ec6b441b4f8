#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "broker/lane.h"

namespace fastcycle::detail {

class Inbox;
class Credits;

/// What the receiver of one lane owes its publisher: a credit for each message that it has.
///
/// @threads  `finish` and `end` by the receiver; all else by the publisher.
/// @realtime No lock, no allocation.
class LaneCredit {
 public:
  explicit LaneCredit(std::shared_ptr<Credits> credits) : credits_(std::move(credits)) {}
  LaneCredit(const LaneCredit&) = delete;
  LaneCredit& operator=(const LaneCredit&) = delete;

  /// One message is done: its callback has returned, or never will be called.
  void finish() noexcept {
    finished_.fetch_add(1, std::memory_order_seq_cst);
    settle();
  }
  /// The receiver takes nothing any more.
  void end() noexcept {
    is_over_.store(true, std::memory_order_seq_cst);
    settle();
  }

 private:
  friend class Credits;

  void settle() noexcept;

  const std::shared_ptr<Credits> credits_;
  std::atomic<std::uint64_t> finished_{0};
  std::atomic<bool> is_over_{false};
  std::atomic<bool> is_awaited_{false};  ///< The publisher has no credit here, and waits for one.
};

/// The credit window of one publisher: how many of its messages may be on their way to each
/// receiver, so that no queue overflows. A receiver gives a credit back when it is done with a
/// message; who ends gives back all.
///
/// A publisher that ran out of credits waits for a credit of each lane that has none. The receiver
/// first counts, then looks whether it is waited for; the publisher first says that it waits, then
/// looks at the count again: one of them sees the other.
///
/// @threads  `lane_returned` is Safe. All else belongs to the publisher: its activations, an
///           external one's mutex, in simulated time also who runs it, between rounds.
/// @realtime No lock, no allocation, except for `add`; at most one wake call.
class Credits {
 public:
  explicit Credits(std::size_t its_window) : window(its_window) {}
  Credits(const Credits&) = delete;
  Credits& operator=(const Credits&) = delete;

  void add(const std::shared_ptr<Lane>& lane) { receivers_.push_back({lane, lane->credit}); }
  void remove(const Lane& lane) noexcept;
  /// The publisher is gone: it waits for nobody, and is told of nothing.
  void leave() noexcept {
    receivers_.clear();  // Their lanes hold this.
    inbox_ = nullptr;
  }

  /// How many messages may be published now, if `staged` are on their way to the lanes.
  [[nodiscard]] std::size_t left(std::uint64_t staged) const noexcept;

  /// From now on waits for credits, if it does not already: `take_returned` will say that they
  /// came.
  void await() noexcept;

  /// True once after each time that what was awaited came.
  [[nodiscard]] bool take_returned() noexcept;

  /// Who is marked, by its timer bit, when credits came.
  void tell(Inbox& inbox) noexcept { inbox_ = &inbox; }

  /// For foreign threads: changes when credits came, or somebody was woken.
  [[nodiscard]] std::uint32_t epoch() const noexcept {
    return epoch_.load(std::memory_order_seq_cst);
  }
  void wait_beyond(std::uint32_t epoch) const noexcept {
    epoch_.wait(epoch, std::memory_order_seq_cst);
  }
  void wake() noexcept;

  /// A lane that was waited for has a credit.
  void lane_returned() noexcept;

  const std::size_t window;

 private:
  struct Receiver {
    std::shared_ptr<Lane> lane;
    std::shared_ptr<LaneCredit> credit;  ///< Its own, apart from what the receiver writes.
  };

  [[nodiscard]] std::size_t left_of(const Receiver& receiver, std::uint64_t staged) const noexcept;

  std::vector<Receiver> receivers_;
  Inbox* inbox_ = nullptr;
  bool is_awaiting_ = false;
  std::atomic<std::uint32_t> awaited_{
      0};  ///< Lanes without credit, and one while they are counted.
  std::atomic<bool> is_returned_{false};
  std::atomic<std::uint32_t> epoch_{0};
};

}  // namespace fastcycle::detail

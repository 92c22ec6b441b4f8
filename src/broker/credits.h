#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "broker/lane.h"
#include "broker/message_export.h"

namespace fastcycle::detail {

class Inbox;
class Credits;

/// Passes credits on to the publisher in another process that the one here represents.
///
/// @threads  Safe.
/// @realtime No allocation; may lock.
class CreditRelay {
 public:
  CreditRelay() = default;
  CreditRelay(const CreditRelay&) = delete;
  CreditRelay& operator=(const CreditRelay&) = delete;
  virtual ~CreditRelay() = default;

  /// A receiver here has finished a message, or ended.
  virtual void credit_returned() noexcept = 0;
};

/// The credits of one lane: its receiver returns one for each message that it has finished.
///
/// @threads  `finish` and `end` by the receiver; all else by the publisher.
/// @realtime No lock, no allocation.
class LaneCredit {
 public:
  explicit LaneCredit(std::shared_ptr<Credits> credits) : credits_(std::move(credits)) {}
  LaneCredit(const LaneCredit&) = delete;
  LaneCredit& operator=(const LaneCredit&) = delete;

  /// One message is finished: its callback has returned, or never will be called.
  void finish() noexcept {
    finished_.fetch_add(1, std::memory_order_seq_cst);
    settle();
  }
  /// The receiver takes no more messages.
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
  std::atomic<bool> is_awaited_{false};  ///< The publisher waits for a credit of this lane.
};

/// The credit window of one publisher: how many of its messages may be on their way to each
/// receiver, so that no queue overflows. A receiver returns a credit when it has finished a
/// message, and all of them when it ends.
///
/// A publisher without credits waits for a credit of each lane that has none. The receiver first
/// counts, then reads the flag of the waiting publisher; the publisher first sets the flag, then
/// reads the count again: one of them sees the other.
///
/// Receivers in another process count together: what matters is the slowest one there. The process
/// is notified by its `ForeignInputs`, which then call `take_foreign`.
///
/// @threads  `lane_returned`, `take_foreign` and `has_foreign` are Safe. All else belongs to the
/// publisher: its activations, an
///           external one's mutex, in simulated time also the driving thread, between rounds.
/// @realtime No lock, no allocation, except for `add`; at most one wake call.
class Credits {
 public:
  explicit Credits(std::size_t its_window) : window(its_window) {}
  Credits(const Credits&) = delete;
  Credits& operator=(const Credits&) = delete;

  void add(const std::shared_ptr<Lane>& lane) { receivers_.push_back({lane, lane->credit}); }
  void remove(const Lane& lane) noexcept;
  /// Receivers in another process. Before anything is published.
  void add(MessageExport& to) { foreign_.push_back(std::make_unique<Foreign>(to)); }
  /// Sets where returned credits are passed on. Before anything is connected.
  void relay_to(CreditRelay& relay) noexcept { relay_ = &relay; }
  /// The publisher is gone: it does not wait, and is not notified any more.
  void leave() noexcept {
    receivers_.clear();  // Their lanes refer to this.
    inbox_ = nullptr;
  }

  /// How many messages may be published now, if `staged` have not reached the lanes yet.
  [[nodiscard]] std::size_t left(std::uint64_t staged) const noexcept;

  /// Starts to wait for credits, if it does not already: `take_returned` will report them.
  void await() noexcept;

  /// True once after each time that the awaited credits were returned.
  [[nodiscard]] bool take_returned() noexcept;

  /// Sets the inbox that is marked, by its timer bit, when credits were returned.
  void set_inbox(Inbox& inbox) noexcept { inbox_ = &inbox; }

  /// For foreign threads: changes when credits were returned, or a thread was woken.
  [[nodiscard]] std::uint32_t epoch() const noexcept {
    return epoch_.load(std::memory_order_seq_cst);
  }
  void wait_beyond(std::uint32_t epoch) const noexcept {
    epoch_.wait(epoch, std::memory_order_seq_cst);
  }
  void wake() noexcept;

  /// An awaited lane has a credit.
  void lane_returned() noexcept;
  /// Takes awaited credits that other processes have returned; true if there were any.
  bool take_foreign() noexcept;
  [[nodiscard]] bool has_foreign() const noexcept;

  const std::size_t window;

 private:
  friend class LaneCredit;

  struct Receiver {
    std::shared_ptr<Lane> lane;
    std::shared_ptr<LaneCredit>
        credit;  ///< On a line of its own, apart from what the receiver writes.
  };

  struct Foreign {
    explicit Foreign(MessageExport& its) : to(its) {}
    MessageExport& to;
    std::atomic<bool> is_awaited{false};
  };

  [[nodiscard]] std::size_t left_of(const Receiver& receiver, std::uint64_t staged) const noexcept;
  [[nodiscard]] std::size_t left_of(const Foreign& foreign, std::uint64_t staged) const noexcept;
  bool settle(Foreign& foreign) noexcept;

  std::vector<Receiver> receivers_;
  std::vector<std::unique_ptr<Foreign>> foreign_;
  CreditRelay* relay_ = nullptr;
  Inbox* inbox_ = nullptr;
  bool is_awaiting_ = false;
  std::atomic<std::uint32_t> awaited_{
      0};  ///< Lanes without credit, and one while they are counted.
  std::atomic<bool> is_returned_{false};
  std::atomic<std::uint32_t> epoch_{0};
};

}  // namespace fastcycle::detail

#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include "base/prefetch.h"
#include "fastcycle/detail/envelope.h"
#include "fastcycle/subscriber.h"

namespace fastcycle::detail {

class Inbox;
class LaneCredit;
class Subscription;

/// Why a message that was published for a subscription never reached its callback.
enum class DropReason : std::uint8_t {
  kOverflow,      ///< The queue was full.
  kSuperseded,    ///< A newer one replaced it in a latest or history view.
  kPool,          ///< The publisher's pool was empty.
  kFault,         ///< The receiving component had failed.
  kShutdown,      ///< The application was stopping, or not started yet.
  kUnsubscribed,  ///< The subscription had ended.
  kInactive,      ///< The receiving component was not active.
  kUnmatched,     ///< A synchronizer found no partner for it.
  kExpired,       ///< It had waited longer than its lifespan.
  kStale,         ///< Its inputs were too old for a latency chain.
  kProcess,       ///< It was lost between two processes.
  kLink,          ///< Another application sent it, and it never arrived.
  kInjected,      ///< Lost by an injected fault.
  kCount,
};

/// A counter with one writer and any number of readers.
class Counter {
 public:
  void add(std::uint64_t amount = 1) noexcept {
    value_.store(value_.load(std::memory_order_relaxed) + amount, std::memory_order_relaxed);
  }
  void set(std::uint64_t value) noexcept { value_.store(value, std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t get() const noexcept {
    return value_.load(std::memory_order_relaxed);
  }

 private:
  std::atomic<std::uint64_t> value_{0};
};

/// The queue of messages from one publisher to one subscription, oldest first, at most `depth`.
///
/// `head` may be advanced from either end, by compare-and-swap: the receiver takes the oldest, and
/// a publisher that finds the lane full drops the oldest. Since it counts in 64 bits, a swap that
/// succeeds means that nothing happened in between. A push never fails and never waits, and no
/// other publisher can hold it up.
///
/// A slot itself has the lap in which it was written, so that its cache line is all that moves from
/// publisher to receiver. `tail` belongs to the publisher; observers and prefetches read it too.
/// The receiver may be past it by the one message whose push has not written it yet.
///
/// Invariants: `head - 1 <= tail <= head + depth`; the slot at `head` shows its lap if and only if
/// a message waits; published = popped by the receiver + dropped + queued.
///
/// @threads  `push` by the publisher only; `peek`, `pop` by one receiver; counters by any thread.
/// @realtime No allocation, no lock, no loop over messages.
class Lane {
 public:
  static constexpr std::uint16_t kWholeHistory = 0xffff;

  struct Options {
    std::size_t depth = 16;
    Overflow overflow = Overflow::kDropOldest;
    bool is_view : 1 = false;               ///< Causes no activation.
    bool is_external : 1 = false;           ///< Filled by a thread outside of FastCycle.
    bool ages : 1 = true;                   ///< Counts for the origin of what timers publish.
    bool is_judged : 1 = false;             ///< Each message is checked before it is delivered.
    bool is_imported : 1 = false;           ///< Its publisher is in another process.
    std::uint16_t history = kWholeHistory;  ///< Latched messages that it receives.
    std::uint16_t room = 0;                 ///< Upper bound of `set_limit`, beyond the depth.
  };

  /// A message in the lane, with what its receiver needs before its callback: the envelope itself
  /// is still in the publisher's cache.
  struct Head {
    std::uint64_t position = 0;
    std::int64_t time_ns = 0;  ///< When it was published.
    std::uint64_t sequence = 0;
    Envelope* envelope = nullptr;
    const google::protobuf::Message* payload = nullptr;
  };

  Lane(Subscription& its_subscription, PublisherId its_publisher, const Options& its_options,
       std::shared_ptr<LaneCredit> its_credit = nullptr)
      : options(its_options),
        subscription(its_subscription),
        publisher(its_publisher),
        limit_(static_cast<std::uint32_t>(its_options.depth)),
        mask_(static_cast<std::uint32_t>(
            round_up(std::max<std::size_t>(its_options.depth, its_options.room)) - 1)),
        slots_(std::make_unique<Slot[]>(std::size_t{mask_} + 1)),
        credit(std::move(its_credit)) {}

  Lane(const Lane&) = delete;
  Lane& operator=(const Lane&) = delete;
  ~Lane() { drain(); }

  /// Adds `envelope`; returns the dropped one, which the caller releases: the oldest, `envelope`
  /// itself, or null.
  [[nodiscard]] Envelope* push(Envelope* envelope) noexcept {
    published.add();
    Envelope* displaced = nullptr;
    const std::uint64_t tail = tail_.load(std::memory_order_relaxed);
    // `head` only grows: room that was seen once still exists, without reading its line.
    const std::uint32_t limit = limit_.load(std::memory_order_relaxed);
    if (tail - known_head_ >= limit) {
      known_head_ = head_.load(std::memory_order_acquire);
    }
    if (tail - known_head_ >= limit) {
      if (options.overflow == Overflow::kDropNewest) {
        overflowed.add();
        return envelope;
      }
      Envelope* oldest =
          envelope_of(slots_[known_head_ & mask_].envelope.load(std::memory_order_relaxed));
      if (head_.compare_exchange_strong(known_head_, known_head_ + 1, std::memory_order_seq_cst)) {
        ++known_head_;
        displaced = oldest;
        overflowed.add();
      }
    }
    Slot& slot = slots_[tail & mask_];
    // Released, so that a receiver which reads this slot too late also sees that `head` moved on.
    slot.time_ns.store(envelope->info.publish_time.time_since_epoch().count(),
                       std::memory_order_release);
    slot.sequence.store(envelope->info.sequence, std::memory_order_release);
    slot.payload.store(envelope->payload, std::memory_order_release);
    slot.envelope.store(reinterpret_cast<std::uintptr_t>(envelope) | lap(tail),
                        std::memory_order_seq_cst);
    tail_.store(tail + 1, std::memory_order_release);
    return displaced;
  }

  /// The oldest message, without removing it; false if there is none. The receiver's.
  [[nodiscard]] bool peek(Head& found) noexcept {
    for (;;) {
      const std::uint64_t head = head_.load(std::memory_order_acquire);
      if (!read(head, found)) {
        if (head_.load(std::memory_order_seq_cst) == head) {
          was_empty_ = true;
          return false;
        }
        continue;
      }
      if (!was_empty_) {
        prepare_following(head);
      }
      was_empty_ = false;
      return true;
    }
  }

  /// Removes the message of `peek`; false if the publisher dropped it meanwhile.
  [[nodiscard]] bool pop(const Head& found) noexcept {
    std::uint64_t expected = found.position;
    return head_.compare_exchange_strong(expected, expected + 1, std::memory_order_seq_cst);
  }

  /// Whether more than `count` messages wait. It reads the slots: the newest message may be there
  /// before `tail` is updated. The receiver's.
  [[nodiscard]] bool holds_more_than(std::size_t count) const noexcept {
    if (count > mask_) {
      return false;
    }
    for (;;) {
      const std::uint64_t head = head_.load(std::memory_order_acquire);
      const std::uint64_t position = head + count;
      const bool is_there =
          (slots_[position & mask_].envelope.load(std::memory_order_seq_cst) & 1) == lap(position);
      if (head_.load(std::memory_order_seq_cst) == head) {
        return is_there;
      }
    }
  }

  /// Sets how many may wait, from the next push on: at most the depth, or the room. Any thread.
  void set_limit(std::size_t limit) noexcept {
    limit_.store(static_cast<std::uint32_t>(limit), std::memory_order_relaxed);
  }

  /// Removes and releases all messages; returns how many. Either end may call it.
  std::uint64_t drain() noexcept {
    std::uint64_t count = 0;
    for (;;) {
      const std::uint64_t head = head_.load(std::memory_order_acquire);
      Head found;
      if (!read(head, found)) {
        if (head_.load(std::memory_order_seq_cst) == head) {
          return count;
        }
      } else if (pop(found)) {
        release(found.envelope);
        ++count;
      }
    }
  }

  /// Prefetches what the next push writes.
  void prepare_push() const noexcept {
    base::prefetch_for_writing(&slots_[tail_.load(std::memory_order_relaxed) & mask_]);
  }
  /// Prefetches what the next `peek` reads.
  void prepare_peek() const noexcept {
    __builtin_prefetch(&slots_[head_.load(std::memory_order_relaxed) & mask_]);
  }

  [[nodiscard]] std::uint64_t queued() const noexcept {
    const std::uint64_t head = head_.load(std::memory_order_acquire);
    const std::uint64_t tail = tail_.load(std::memory_order_acquire);
    return tail > head ? tail - head : 0;
  }

  /// When the newest message that was pushed was published, in nanoseconds; the smallest time if
  /// there was none. For observers.
  [[nodiscard]] std::int64_t newest_ns() const noexcept {
    const std::uint64_t tail = tail_.load(std::memory_order_acquire);
    return tail == 0 ? std::numeric_limits<std::int64_t>::min()
                     : slots_[(tail - 1) & mask_].time_ns.load(std::memory_order_acquire);
  }

  /// Messages passed to the receiver, which no push has dropped. The publisher's.
  [[nodiscard]] std::uint64_t passed_on() const noexcept {
    return published.get() - overflowed.get() - dropped_by_pool.get() - dropped_after_close.get() -
           dropped_outside.get();
  }

  // Constant after construction.
  const Options options;
  Subscription& subscription;
  const PublisherId publisher;

  /// The word that distinguishes lanes which share a bit of the inbox's state word; null if it has
  /// a bit of its own. As `place`.
  std::atomic<std::uint64_t>* shared_word = nullptr;

 private:
  struct alignas(32) Slot {
    std::atomic<std::int64_t> time_ns{0};
    std::atomic<std::uint64_t> sequence{0};
    std::atomic<const google::protobuf::Message*> payload{nullptr};
    /// With the lap in its lowest bit; written last.
    std::atomic<std::uintptr_t> envelope{0};
  };

  std::atomic<std::uint32_t> limit_;  ///< Its depth, except for a standby.
  const std::uint32_t mask_;
  const std::unique_ptr<Slot[]> slots_;

 public:
  /// The index of its bit: in the inbox's state word, or among those behind the shared bit. Set by
  /// the inbox, before the publisher has the lane.
  unsigned place = 0;
  /// Set once by the receiver; `kCount` while the lane is open.
  std::atomic<DropReason> close_reason{DropReason::kCount};
  [[nodiscard]] bool is_closed() const noexcept {
    return close_reason.load(std::memory_order_seq_cst) != DropReason::kCount;
  }

  // Written by the publisher, on a line of its own.
  alignas(64) Counter published;
  Counter overflowed;
  Counter dropped_by_pool;
  Counter dropped_after_close;
  /// Published by an external thread before the start or after the stop; of an imported lane, lost
  /// between the processes.
  Counter dropped_outside;
  std::atomic<bool> is_left_by_publisher{false};
  /// The receiver keeps more than its share of the pool, and receives no further message. The
  /// publisher's.
  bool is_held_back = false;

 private:
  std::atomic<std::uint64_t> tail_{0};
  std::uint64_t known_head_ = 0;  ///< The publisher's: `head` is at least this.

 public:
  // Written by the receiver, on a line of its own.
  alignas(64) Counter delivered;
  Counter drained;  ///< Removed when it was closed, for `close_reason`.
  std::atomic<bool> is_left_by_receiver{false};
  /// Constant: where the receiver returns credits. Null if the publisher uses none.
  const std::shared_ptr<LaneCredit> credit;

 private:
  std::atomic<std::uint64_t> head_{0};
  std::uint64_t known_tail_ = 0;  ///< The receiver's: `tail` is at least this.
  bool was_empty_ = true;         ///< The receiver's: its last read found nothing.

  /// Prefetches the message that follows `head`, while that one is served: in a burst, another CPU
  /// wrote it just now.
  void prepare_following(std::uint64_t head) noexcept {
    if (head + 1 >= known_tail_) {
      known_tail_ = tail_.load(std::memory_order_relaxed);
    }
    if (head + 1 < known_tail_) {
      const Slot& next = slots_[(head + 1) & mask_];
      __builtin_prefetch(next.payload.load(std::memory_order_relaxed));
      const auto* envelope =
          reinterpret_cast<const char*>(envelope_of(next.envelope.load(std::memory_order_relaxed)));
      base::prefetch_for_writing(envelope);
      base::prefetch_for_writing(envelope + 64);
    }
  }

  /// Distinguishes what was pushed to `position` from the slot's content one lap before.
  [[nodiscard]] std::uintptr_t lap(std::uint64_t position) const noexcept {
    return (position & (std::uint64_t{mask_} + 1)) == 0 ? 1 : 0;
  }
  [[nodiscard]] static Envelope* envelope_of(std::uintptr_t word) noexcept {
    return reinterpret_cast<Envelope*>(word & ~std::uintptr_t{1});
  }

  /// Reads the message at `head`; false if there is none, or `head` has advanced meanwhile.
  [[nodiscard]] bool read(std::uint64_t head, Head& found) const noexcept {
    const Slot& slot = slots_[head & mask_];
    const std::uintptr_t word = slot.envelope.load(std::memory_order_seq_cst);
    if ((word & 1) != lap(head)) {
      return false;
    }
    found.time_ns = slot.time_ns.load(std::memory_order_acquire);
    found.sequence = slot.sequence.load(std::memory_order_acquire);
    found.payload = slot.payload.load(std::memory_order_acquire);
    found.envelope = envelope_of(word);
    found.position = head;
    return head_.load(std::memory_order_acquire) == head;
  }

  static std::size_t round_up(std::size_t depth) noexcept {
    std::size_t size = 1;
    while (size < depth) {
      size *= 2;
    }
    return size;
  }
};

// What a push reads and does not write, its publisher's line, and its receiver's.
static_assert(sizeof(Lane) == std::size_t{3} * 64);

/// The oldest message of a lane.
struct LaneHead {
  Lane* lane = nullptr;
  Lane::Head head;

  /// Makes it `other`, if that is older: earlier publish time first; of two publishers in the same
  /// nanosecond the smaller id.
  void take_older(Lane& other, const Lane::Head& its_head) noexcept {
    if (lane == nullptr || (its_head.time_ns != head.time_ns ? its_head.time_ns < head.time_ns
                                                             : other.publisher < lane->publisher)) {
      *this = {.lane = &other, .head = its_head};
    }
  }
};

}  // namespace fastcycle::detail

#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/prefetch.h"
#include "broker/lane.h"
#include "broker/shared_bit.h"

namespace fastcycle::detail {

/// The queue of components that are ready to run. An executor is one.
///
/// @threads  Safe.
/// @realtime As `publish` is.
class ReadyQueue {
 public:
  ReadyQueue() = default;
  ReadyQueue(const ReadyQueue&) = delete;
  ReadyQueue& operator=(const ReadyQueue&) = delete;
  virtual ~ReadyQueue() = default;

  /// Queues the component `index`, without waking a worker.
  virtual void enqueue(std::uint32_t index) noexcept = 0;

  /// Wakes a worker for the queued components, if one sleeps.
  virtual void wake() noexcept = 0;

  /// Prefetches what `enqueue` and `wake` will write.
  virtual void prepare(std::uint32_t index) noexcept = 0;
};

/// All lanes that lead to one component, and one state word of ready bits.
///
/// A push ends by setting its lane's bit; only the step from nothing to something queues the
/// component, so that a busy receiver costs a publisher one atomic step. The worker that serves the
/// component clears a bit only after finding the lane empty, and then reads the lane again. It
/// takes the smallest publish time among the lanes' heads, and only if the word, read again, shows
/// no other ready lane: so if one push returned before another began, it is served first.
///
/// The first 59 lanes have a bit each. All others share the last one, and `SharedBit` distinguishes
/// them.
///
/// @threads  `mark` is Safe; `begin`, `end`, `peek`, `pop` and the lists of lanes belong to the one
///           worker that serves the component, and before the start to the control thread.
/// @realtime No allocation, no lock. The time of `peek` grows with the number of ready lanes that
///           have a bit each; for the others see `SharedBit`.
class Inbox {
 public:
  static constexpr unsigned kLaneBits = 60;
  static constexpr std::uint64_t kLaneMask = (std::uint64_t{1} << kLaneBits) - 1;
  static constexpr unsigned kOwnBits = kLaneBits - 1;  ///< Lanes that have a bit each.
  static constexpr std::uint64_t kSharedBit = std::uint64_t{1} << kOwnBits;
  static constexpr std::uint64_t kTimerBit = std::uint64_t{1} << 60;
  static constexpr std::uint64_t kControlBit = std::uint64_t{1} << 61;
  static constexpr std::uint64_t kRunningBit = std::uint64_t{1} << 63;

  using Head = LaneHead;

  /// How many messages may wait in a lane while the component is a standby. Set before lanes are
  /// added.
  std::uint16_t lane_room = 0;

  Inbox() = default;
  Inbox(const Inbox&) = delete;
  Inbox& operator=(const Inbox&) = delete;

  /// Sets the queue that serves this component: once, before anything is pushed.
  ///
  /// With `is_watched` its worker polls the lanes: a publisher's prefetch would only move the cache
  /// line once more.
  void attach(ReadyQueue& queue, std::uint32_t index, bool is_watched = false) noexcept {
    queue_ = &queue;
    index_ = index;
    is_watched_ = is_watched;
  }
  [[nodiscard]] bool is_watched() const noexcept { return is_watched_; }
  [[nodiscard]] ReadyQueue& queue() const noexcept { return *queue_; }

  /// Adds `lane` and assigns its place, before its publisher has it. Worker, or control thread
  /// before the start.
  void add(std::shared_ptr<Lane> lane);
  /// Does nothing for a lane that was removed, or never added.
  void remove(const Lane& lane) noexcept;

  /// The bit of the state word to set after a push into `lane`; 0 for one that causes no
  /// activation.
  [[nodiscard]] static std::uint64_t bit_of(const Lane& lane) noexcept {
    if (lane.options.is_view) {
      return 0;
    }
    return lane.shared_word != nullptr ? kSharedBit : std::uint64_t{1} << lane.place;
  }

  [[nodiscard]] const std::vector<std::shared_ptr<Lane>>& views() const noexcept { return views_; }

  /// Sets bits; returns true if that queued the component, whose queue must then be woken.
  ///
  /// Bits that are set already need no write: the worker clears a bit before its last read, so a
  /// push that finds it set afterwards will be seen.
  bool mark(std::uint64_t bits) noexcept {
    if ((state_.load(std::memory_order_seq_cst) & bits) == bits) {
      return false;
    }
    if (state_.fetch_or(bits, std::memory_order_seq_cst) == 0) {
      queue_->enqueue(index_);
      return true;
    }
    return false;
  }

  /// As `mark`, after a push into `lane`, whose bit is `bit`.
  bool mark(const Lane& lane, std::uint64_t bit) noexcept {
    if (bit == kSharedBit) [[unlikely]] {
      SharedBit::mark(lane);  // First: the worker clears them in the other order.
    }
    return mark(bit);
  }

  /// Prefetches what `mark` and the wake after it will write.
  void prepare_mark() noexcept {
    base::prefetch_for_writing(&state_);
    queue_->prepare(index_);
  }

  /// As `mark`, but queues the component in any case: for causes that are served even if others
  /// wait.
  void mark_control() noexcept {
    state_.fetch_or(kControlBit, std::memory_order_seq_cst);
    queue_->enqueue(index_);
  }

  /// Prefetches what a turn will read first. Only by the one worker that may serve the component.
  void prepare_serve() const noexcept {
    base::prefetch_for_writing(&state_);
    for (const Lane* lane : few_lanes_) {
      if (lane != nullptr) {
        lane->prepare_peek();
      }
    }
  }

  /// Starts a turn; false if another worker serves the component already.
  [[nodiscard]] bool begin() noexcept {
    return (state_.fetch_or(kRunningBit, std::memory_order_seq_cst) & kRunningBit) == 0;
  }

  /// Ends a turn in which nothing was left; false if something arrived meanwhile: then continue.
  [[nodiscard]] bool try_end_idle() noexcept {
    std::uint64_t expected = kRunningBit;
    return state_.compare_exchange_strong(expected, 0, std::memory_order_seq_cst);
  }

  /// Ends a turn before everything was served; the component is queued again if it must be.
  void end_early() noexcept {
    if ((state_.fetch_and(~kRunningBit, std::memory_order_seq_cst) & ~kRunningBit) != 0) {
      queue_->enqueue(index_);
    }
  }

  /// Ends a turn of a component that serves no lanes yet; false if control causes arrived
  /// meanwhile.
  [[nodiscard]] bool try_end_unopened() noexcept;

  /// Clears `bit` (timer or control) and returns whether it was set.
  bool take_bit(std::uint64_t bit) noexcept {
    return (state_.load(std::memory_order_seq_cst) & bit) != 0 &&
           (state_.fetch_and(~bit, std::memory_order_seq_cst) & bit) != 0;
  }

  /// Clears the bits of all ready lanes, and calls `take` with each of these lanes: a later push
  /// sets its bit again. Worker only.
  template <typename Take>
  void take_ready(const Take& take) noexcept {
    std::uint64_t ready = state_.fetch_and(~kLaneMask, std::memory_order_seq_cst) & kLaneMask;
    const bool is_shared_ready = (ready & kSharedBit) != 0;
    for (ready &= ~kSharedBit; ready != 0; ready &= ready - 1) {
      if (const auto& lane = lanes_[static_cast<unsigned>(std::countr_zero(ready))]) {
        take(*lane);
      }
    }
    if (is_shared_ready) {
      shared_.take_marked(take);
    }
  }

  /// Marks all lanes: they are read in this turn, or in the next one if the worker serves the
  /// component without a turn. Worker only.
  void mark_all() noexcept {
    shared_.mark_all();
    if (state_.fetch_or(kLaneMask, std::memory_order_seq_cst) == 0) {
      queue_->enqueue(index_);
    }
  }

  /// Within a turn: control causes wait for the next one. Worker only.
  void keep_control() noexcept { state_.fetch_or(kControlBit, std::memory_order_seq_cst); }

  /// The oldest message of all lanes, without removing it; false if there is none.
  [[nodiscard]] bool peek(Head& found) noexcept {
    // The usual case: one lane is ready, has a bit of its own, and is not empty.
    const std::uint64_t ready = state_.load(std::memory_order_seq_cst) & kLaneMask;
    if (ready != 0 && (ready & (ready - 1)) == 0) {
      Lane* const lane = lanes_[static_cast<unsigned>(std::countr_zero(ready))].get();
      if (lane != nullptr && lane->peek(found.head) &&
          (state_.load(std::memory_order_seq_cst) & kLaneMask) == ready) {
        found.lane = lane;
        return true;
      }
    }
    return ready != 0 && peek_all(found);
  }

  /// As `peek`, without the state word: for a component's only worker, which polls, when the
  /// publisher has pushed but not marked yet. False also if there are many lanes, or if the oldest
  /// message cannot be determined.
  [[nodiscard]] bool peek_early(Head& found) noexcept {
    if (few_lanes_[1] == nullptr) {
      found.lane = few_lanes_[0];
      return found.lane != nullptr && found.lane->peek(found.head);
    }
    if (!peek_few(found)) {
      return false;
    }
    // A lane found empty may have been filled before one that was read after it; the same result
    // twice is older than all that arrived in between.
    Head again;
    return peek_few(again) && again.lane == found.lane &&
           again.head.position == found.head.position;
  }

  /// Removes the message of `peek`; false if it is gone: then peek again.
  [[nodiscard]] static bool pop(const Head& found) noexcept { return found.lane->pop(found.head); }

  /// Whether nothing is ready, and no worker serves the component.
  [[nodiscard]] bool is_quiet() const noexcept {
    return state_.load(std::memory_order_seq_cst) == 0;
  }
  [[nodiscard]] std::uint64_t state() const noexcept {
    return state_.load(std::memory_order_seq_cst);
  }
  /// The lanes behind the last bit.
  [[nodiscard]] const SharedBit& shared() const noexcept { return shared_; }

 private:
  void find_few_lanes() noexcept;
  [[nodiscard]] bool peek_few(Head& best) noexcept;
  [[nodiscard]] bool peek_all(Head& found) noexcept;
  bool peek_bit(unsigned bit, Head& best) noexcept;

  // Constant once attached.
  ReadyQueue* queue_ = nullptr;
  std::uint32_t index_ = 0;
  bool is_watched_ = false;

  /// Written by publishers and worker, on a line of its own.
  alignas(64) std::atomic<std::uint64_t> state_{0};

  // Worker only.
  alignas(64) std::array<std::shared_ptr<Lane>, kLaneBits> lanes_;  ///< None at the shared bit.
  SharedBit shared_;
  std::vector<std::shared_ptr<Lane>> views_;
  std::array<Lane*, 4> few_lanes_{};  ///< All lanes that cause activations, if they are so few.
};

}  // namespace fastcycle::detail

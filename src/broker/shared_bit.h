#pragma once

#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "broker/lane.h"

namespace fastcycle::detail {

/// The lanes of one inbox that share a bit of its state word: which of them are marked, and which
/// of these holds the oldest message.
///
/// Each has a bit of its own in a second row of words. A push sets first that, then the shared bit.
/// The worker proceeds in reverse: it clears the shared bit, then searches for marked lanes; and it
/// clears a lane's own bit, then reads the lane: a push that finds its bit set will be seen.
///
/// Marked lanes are in a heap, by a lower bound of their messages' times: the publish times of a
/// lane never decrease, so reading the top lane is enough. It sinks if its oldest message is newer
/// than the bound, and is removed if it is empty.
///
/// Invariant: a lane is in the heap if and only if it is `held_`, and then its bit is set.
///
/// @threads  `mark` is Safe; all else as in `Inbox`.
/// @realtime No allocation, no lock, except for `add`. `peek` reads one word for 64 lanes, each
///           newly marked lane once, and beyond that one or two of them for each message.
class SharedBit {
 public:
  SharedBit() = default;
  SharedBit(const SharedBit&) = delete;
  SharedBit& operator=(const SharedBit&) = delete;

  /// Adds `lane`, and assigns its place.
  void add(std::shared_ptr<Lane> lane);
  void remove(const Lane& lane) noexcept;
  [[nodiscard]] bool is_empty() const noexcept { return lane_count_ == 0; }

  /// Something was pushed into `lane`; the shared bit is to be set after that.
  static void mark(const Lane& lane) noexcept {
    const std::uint64_t flag = flag_of(lane.place);
    if ((lane.shared_word->load(std::memory_order_seq_cst) & flag) == 0) {
      lane.shared_word->fetch_or(flag, std::memory_order_seq_cst);
    }
  }
  void mark_all() noexcept;

  /// Sets `best` to the oldest message of all marked lanes, if it is older than `best`; false if
  /// none holds a message. Before it returns it searches for newly marked lanes, so that it has
  /// seen each push that returned before `best` was pushed.
  bool peek(LaneHead& best) noexcept;

  /// Clears the bits of all marked lanes, and calls `take` with each of them. The shared bit has
  /// been cleared before.
  template <typename Take>
  void take_marked(const Take& take) noexcept {
    heap_.clear();
    for (std::size_t row = 0; row < held_.size(); ++row) {
      held_[row] = 0;
      std::uint64_t marked = marked_[row].exchange(0, std::memory_order_seq_cst);
      for (; marked != 0; marked &= marked - 1) {
        const std::size_t place = row * kRow + static_cast<unsigned>(std::countr_zero(marked));
        if (place < lanes_.size() && lanes_[place] != nullptr) {
          take(*lanes_[place]);
        }
      }
    }
  }

  /// How many lanes `peek` has read so far: its cost.
  [[nodiscard]] std::uint64_t looks() const noexcept { return looks_; }

 private:
  static constexpr unsigned kRow = 64;

  struct Held {
    Lane* lane;
    std::int64_t time_ns;  ///< Lower bound of its messages' publish times.
  };
  /// For the heaps of the standard library, which have the greatest on top.
  static bool is_served_later(const Held& a, const Held& b) noexcept {
    return a.time_ns != b.time_ns ? a.time_ns > b.time_ns : a.lane->publisher > b.lane->publisher;
  }
  [[nodiscard]] static std::uint64_t flag_of(unsigned place) noexcept {
    return std::uint64_t{1} << (place % kRow);
  }

  bool peek_held(LaneHead& best) noexcept;
  bool hold_marked() noexcept;
  [[nodiscard]] bool look_again(Lane& lane, Lane::Head& head) noexcept;
  void let_go_of_first() noexcept;

  /// The lanes' bits. Publishers point to them, so they never move.
  std::deque<std::atomic<std::uint64_t>> marked_;

  // Worker only.
  std::vector<std::uint64_t> held_;  ///< The bits of `marked_` whose lanes are in the heap.
  std::vector<std::shared_ptr<Lane>> lanes_;  ///< By place; null if it is free.
  std::vector<unsigned> free_;                ///< Places.
  std::vector<Held> heap_;
  std::size_t lane_count_ = 0;
  std::uint64_t looks_ = 0;
};

}  // namespace fastcycle::detail

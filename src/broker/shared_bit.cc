#include "broker/shared_bit.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace fastcycle::detail {

void SharedBit::add(std::shared_ptr<Lane> lane) {
  if (free_.empty()) {
    free_.push_back(static_cast<unsigned>(lanes_.size()));
    lanes_.emplace_back();
    // The worker must not allocate later.
    free_.reserve(lanes_.capacity());
    heap_.reserve(lanes_.capacity());
    if (lanes_.size() > held_.size() * kRow) {
      held_.push_back(0);
      marked_.emplace_back(0);
    }
  }
  const unsigned place = free_.back();
  free_.pop_back();
  lane->place = place;
  lane->shared_word = &marked_[place / kRow];
  lanes_[place] = std::move(lane);
  ++lane_count_;
}

void SharedBit::remove(const Lane& lane) noexcept {
  const unsigned place = lane.place;
  if (place >= lanes_.size() || lanes_[place].get() != &lane) {
    return;
  }
  if ((held_[place / kRow] & flag_of(place)) != 0) {
    held_[place / kRow] &= ~flag_of(place);
    std::erase_if(heap_, [&](const Held& held) { return held.lane == &lane; });
    std::make_heap(heap_.begin(), heap_.end(), is_served_later);
  }
  // Its publisher may set the bit once more: then the next lane with that bit is read needlessly.
  lanes_[place].reset();
  free_.push_back(place);
  --lane_count_;
}

void SharedBit::mark_all() noexcept {
  for (auto& marked : marked_) {
    marked.store(~std::uint64_t{0}, std::memory_order_seq_cst);
  }
}

bool SharedBit::peek(LaneHead& best) noexcept {
  bool is_ready = false;
  do {
    is_ready = peek_held(best);
  } while (hold_marked());
  return is_ready;
}

bool SharedBit::peek_held(LaneHead& best) noexcept {
  while (!heap_.empty()) {
    Held& first = heap_.front();
    Lane::Head head;
    ++looks_;
    if (!first.lane->peek(head) && !look_again(*first.lane, head)) {
      let_go_of_first();
      continue;
    }
    if (head.time_ns == first.time_ns) {
      best.take_older(*first.lane, head);
      return true;
    }
    std::pop_heap(heap_.begin(), heap_.end(), is_served_later);
    heap_.back().time_ns = head.time_ns;
    std::push_heap(heap_.begin(), heap_.end(), is_served_later);
  }
  return false;
}

bool SharedBit::look_again(Lane& lane, Lane::Head& head) noexcept {
  // Empty: clear the bit, then look again, since a push may have come in between.
  lane.shared_word->fetch_and(~flag_of(lane.place), std::memory_order_seq_cst);
  if (!lane.peek(head)) {
    return false;
  }
  lane.shared_word->fetch_or(flag_of(lane.place), std::memory_order_seq_cst);
  return true;
}

void SharedBit::let_go_of_first() noexcept {
  const unsigned place = heap_.front().lane->place;
  held_[place / kRow] &= ~flag_of(place);
  std::pop_heap(heap_.begin(), heap_.end(), is_served_later);
  heap_.pop_back();
}

/// Takes what was marked meanwhile into the heap, unseen; false if nothing was.
bool SharedBit::hold_marked() noexcept {
  bool is_any = false;
  for (std::size_t row = 0; row < held_.size(); ++row) {
    std::uint64_t fresh = marked_[row].load(std::memory_order_seq_cst) & ~held_[row];
    for (; fresh != 0; fresh &= fresh - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(fresh));
      const std::uint64_t flag = std::uint64_t{1} << bit;
      const std::size_t place = row * kRow + bit;
      if (place >= lanes_.size() || lanes_[place] == nullptr) {
        marked_[row].fetch_and(~flag, std::memory_order_seq_cst);
        continue;
      }
      held_[row] |= flag;
      heap_.push_back({lanes_[place].get(), std::numeric_limits<std::int64_t>::min()});
      std::push_heap(heap_.begin(), heap_.end(), is_served_later);
      is_any = true;
    }
  }
  return is_any;
}

}  // namespace fastcycle::detail

#include "broker/inbox.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace fastcycle::detail {

void Inbox::add(std::shared_ptr<Lane> lane) {
  if (lane->options.is_view) {
    views_.push_back(std::move(lane));
    return;
  }
  const auto own_end = lanes_.begin() + kOwnBits;
  const auto free = std::find(lanes_.begin(), own_end, nullptr);
  if (free == own_end) {
    shared_.add(std::move(lane));
  } else {
    lane->place = static_cast<unsigned>(free - lanes_.begin());
    *free = std::move(lane);
  }
  find_few_lanes();
}

void Inbox::remove(const Lane& lane) noexcept {
  if (lane.options.is_view) {
    std::erase_if(views_, [&](const auto& other) { return other.get() == &lane; });
  } else if (lane.shared_word != nullptr) {
    shared_.remove(lane);
  } else if (lanes_[lane.place].get() == &lane) {
    // Its publisher may set the bit once more: then the next lane with that bit is read needlessly.
    lanes_[lane.place].reset();
  }
  find_few_lanes();
}

void Inbox::find_few_lanes() noexcept {
  few_lanes_ = {};
  if (!shared_.is_empty()) {
    return;
  }
  std::size_t count = 0;
  for (const auto& lane : lanes_) {
    if (lane == nullptr) {
      continue;
    }
    if (count == few_lanes_.size()) {
      few_lanes_ = {};
      return;
    }
    few_lanes_[count++] = lane.get();
  }
}

bool Inbox::peek_few(Head& best) noexcept {
  best.lane = nullptr;
  for (Lane* lane : few_lanes_) {
    Lane::Head head;
    if (lane == nullptr) {
      break;
    }
    if (lane->peek(head)) {
      best.take_older(*lane, head);
    }
  }
  return best.lane != nullptr;
}

bool Inbox::peek_bit(unsigned bit, Head& best) noexcept {
  if (bit == kOwnBits) {
    return shared_.peek(best);
  }
  Lane* const lane = lanes_[bit].get();
  Lane::Head head;
  if (lane == nullptr || !lane->peek(head)) {
    return false;
  }
  best.take_older(*lane, head);
  return true;
}

bool Inbox::peek_all(Head& found) noexcept {
  for (;;) {
    Head best;
    std::uint64_t seen = 0;
    std::uint64_t ready = state_.load(std::memory_order_seq_cst) & kLaneMask;
    // The shared bit is last: its `peek` searches for newly marked lanes after the oldest message
    // was found in any lane.
    while (ready != 0) {
      const auto bit = static_cast<unsigned>(std::countr_zero(ready));
      const std::uint64_t flag = std::uint64_t{1} << bit;
      ready &= ~flag;
      if (peek_bit(bit, best)) {
        seen |= flag;
        continue;
      }
      // Empty: clear the bit, then look again, since a push may have come in between.
      state_.fetch_and(~flag, std::memory_order_seq_cst);
      if (peek_bit(bit, best)) {
        state_.fetch_or(flag, std::memory_order_seq_cst);
        seen |= flag;
      }
    }
    if ((state_.load(std::memory_order_seq_cst) & kLaneMask & ~seen) == 0) {
      found = best;
      return best.lane != nullptr;
    }
  }
}

bool Inbox::try_end_unopened() noexcept {
  std::uint64_t state = state_.load(std::memory_order_seq_cst);
  while ((state & kControlBit) == 0) {
    if (state_.compare_exchange_weak(state, state & ~kRunningBit, std::memory_order_seq_cst)) {
      return true;
    }
  }
  return false;
}

}  // namespace fastcycle::detail

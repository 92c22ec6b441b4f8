#include "broker/inbox.h"

#include <bit>
#include <utility>

namespace fastcycle::detail {
namespace {

/// Earlier publish time first; of two publishers in the same nanosecond the smaller id.
bool is_before(const Lane& a, std::int64_t a_ns, const Lane& b, std::int64_t b_ns) noexcept {
  return a_ns != b_ns ? a_ns < b_ns : a.publisher < b.publisher;
}

}  // namespace

void Inbox::add(std::shared_ptr<Lane> lane) {
  auto& list = lane->options.is_view ? views_ : lanes_[lane->bit];
  list.push_back(std::move(lane));
  find_few_lanes();
}

void Inbox::remove(const Lane& lane) noexcept {
  auto& list = lane.options.is_view ? views_ : lanes_[lane.bit];
  std::erase_if(list, [&](const std::shared_ptr<Lane>& other) { return other.get() == &lane; });
  find_few_lanes();
}

void Inbox::find_few_lanes() noexcept {
  few_lanes_ = {};
  std::size_t count = 0;
  for (const auto& list : lanes_) {
    for (const auto& lane : list) {
      if (count == few_lanes_.size()) {
        few_lanes_ = {};
        return;
      }
      few_lanes_[count++] = lane.get();
    }
  }
}

bool Inbox::peek_few(Head& best) noexcept {
  best.lane = nullptr;
  for (Lane* lane : few_lanes_) {
    Lane::Head head;
    if (lane == nullptr) {
      break;
    }
    if (lane->peek(head) &&
        (best.lane == nullptr || is_before(*lane, head.time_ns, *best.lane, best.head.time_ns))) {
      best = {lane, head};
    }
  }
  return best.lane != nullptr;
}

bool Inbox::peek_bit(unsigned bit, Head& best) noexcept {
  bool is_ready = false;
  for (const auto& lane : lanes_[bit]) {
    Lane::Head head;
    if (!lane->peek(head)) {
      continue;
    }
    is_ready = true;
    if (best.lane == nullptr || is_before(*lane, head.time_ns, *best.lane, best.head.time_ns)) {
      best = {lane.get(), head};
    }
  }
  return is_ready;
}

bool Inbox::peek_all(Head& found) noexcept {
  Head last;
  for (;;) {
    Head best;
    std::uint64_t seen = 0;
    bool has_shared_bits = false;
    std::uint64_t ready = state_.load(std::memory_order_seq_cst) & kLaneMask;
    while (ready != 0) {
      const auto bit = static_cast<unsigned>(std::countr_zero(ready));
      const std::uint64_t flag = std::uint64_t{1} << bit;
      ready &= ~flag;
      has_shared_bits = has_shared_bits || lanes_[bit].size() > 1;
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
    if ((state_.load(std::memory_order_seq_cst) & kLaneMask & ~seen) != 0) {
      continue;
    }
    // Lanes that share a bit hide behind each other: one found empty may have been filled before
    // another that was looked at after it. What is found twice came before all that came between.
    const bool is_found_again = best.lane == last.lane && best.head.position == last.head.position;
    if (best.lane == nullptr || !has_shared_bits || is_found_again) {
      found = best;
      return best.lane != nullptr;
    }
    last = best;
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

#include "broker/credits.h"

#include <algorithm>

#include "broker/inbox.h"

namespace fastcycle::detail {

void LaneCredit::settle() noexcept {
  if (is_awaited_.load(std::memory_order_seq_cst) &&
      is_awaited_.exchange(false, std::memory_order_seq_cst)) {
    credits_->lane_returned();
  }
}

void Credits::remove(const Lane& lane) noexcept {
  std::erase_if(receivers_, [&](const Receiver& receiver) { return receiver.lane.get() == &lane; });
}

std::size_t Credits::left_of(const Receiver& receiver, std::uint64_t staged) const noexcept {
  if (receiver.credit->is_over_.load(std::memory_order_seq_cst)) {
    return window;
  }
  const std::uint64_t limit = std::min(window, receiver.lane->options.depth);
  const std::uint64_t used = receiver.lane->passed_on() + staged -
                             receiver.credit->finished_.load(std::memory_order_seq_cst);
  return limit - std::min(limit, used);
}

std::size_t Credits::left(std::uint64_t staged) const noexcept {
  std::size_t least = window - std::min<std::uint64_t>(window, staged);
  for (const Receiver& receiver : receivers_) {
    least = std::min(least, left_of(receiver, staged));
  }
  return least;
}

void Credits::await() noexcept {
  if (std::exchange(is_awaiting_, true)) {
    return;
  }
  awaited_.store(1, std::memory_order_seq_cst);
  for (const Receiver& receiver : receivers_) {
    if (left_of(receiver, 0) > 0) {
      continue;
    }
    awaited_.fetch_add(1, std::memory_order_seq_cst);
    receiver.credit->is_awaited_.store(true, std::memory_order_seq_cst);
    if (left_of(receiver, 0) > 0) {
      receiver.credit->settle();
    }
  }
  lane_returned();
}

void Credits::lane_returned() noexcept {
  if (awaited_.fetch_sub(1, std::memory_order_seq_cst) != 1) {
    return;
  }
  is_returned_.store(true, std::memory_order_seq_cst);
  if (inbox_ != nullptr && inbox_->mark(Inbox::kTimerBit)) {
    inbox_->queue().wake();
  }
  wake();
}

bool Credits::take_returned() noexcept {
  if (!is_returned_.load(std::memory_order_seq_cst)) {
    return false;
  }
  is_returned_.store(false, std::memory_order_seq_cst);
  is_awaiting_ = false;
  return true;
}

void Credits::wake() noexcept {
  epoch_.fetch_add(1, std::memory_order_seq_cst);
  epoch_.notify_all();
}

}  // namespace fastcycle::detail

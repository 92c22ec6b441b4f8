#include "broker/credits.h"

#include <algorithm>

#include "broker/inbox.h"

namespace fastcycle::detail {

void LaneCredit::settle() noexcept {
  if (is_awaited_.load(std::memory_order_seq_cst) &&
      is_awaited_.exchange(false, std::memory_order_seq_cst)) {
    credits_->lane_returned();
  }
  if (credits_->relay_ != nullptr) {
    credits_->relay_->credit_returned();
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

std::size_t Credits::left_of(const Foreign& foreign, std::uint64_t staged) const noexcept {
  return window - std::min<std::uint64_t>(window, foreign.to.unfinished() + staged);
}

std::size_t Credits::left(std::uint64_t staged) const noexcept {
  std::size_t least = window - std::min<std::uint64_t>(window, staged);
  for (const Receiver& receiver : receivers_) {
    least = std::min(least, left_of(receiver, staged));
  }
  for (const auto& foreign : foreign_) {
    least = std::min(least, left_of(*foreign, staged));
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
  for (const auto& foreign : foreign_) {
    if (left_of(*foreign, 0) > 0) {
      continue;
    }
    awaited_.fetch_add(1, std::memory_order_seq_cst);
    foreign->to.set_awaited(true);
    foreign->is_awaited.store(true, std::memory_order_seq_cst);
    if (left_of(*foreign, 0) > 0) {
      settle(*foreign);
    }
  }
  lane_returned();
}

bool Credits::settle(Foreign& foreign) noexcept {
  if (!foreign.is_awaited.exchange(false, std::memory_order_seq_cst)) {
    return false;
  }
  foreign.to.set_awaited(false);  // Before the publisher can wait again.
  lane_returned();
  return true;
}

bool Credits::has_foreign() const noexcept {
  return std::ranges::any_of(foreign_, [this](const auto& foreign) {
    return foreign->is_awaited.load(std::memory_order_seq_cst) && left_of(*foreign, 0) > 0;
  });
}

bool Credits::take_foreign() noexcept {
  bool has_taken = false;
  for (const auto& foreign : foreign_) {
    if (foreign->is_awaited.load(std::memory_order_seq_cst) && left_of(*foreign, 0) > 0) {
      has_taken |= settle(*foreign);
    }
  }
  return has_taken;
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

#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "broker/inbox.h"

namespace fastcycle::detail {

/// The executors to wake once all pushes are done; more than fit are woken at once.
class WakeList {
 public:
  void add(ReadyQueue& queue) noexcept {
    const auto end = queues_.begin() + static_cast<std::ptrdiff_t>(size_);
    if (std::find(queues_.begin(), end, &queue) != end) {
      return;
    }
    if (size_ == queues_.size()) {
      queue.wake();
      return;
    }
    queues_[size_++] = &queue;
  }

  void wake_all() noexcept {
    for (std::size_t i = 0; i < size_; ++i) {
      queues_[i]->wake();
    }
  }

 private:
  std::array<ReadyQueue*, 16>
      queues_;  ///< Only `size_` of them are initialized, since each publish constructs a list.
  std::size_t size_ = 0;
};

}  // namespace fastcycle::detail

#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <utility>

#include "dds_gateway/bell.h"

namespace fastcycle::dds_gateway {

/// Messages of a reader on their way from the receiving thread to the one that serves the
/// participant: at most the newest `depth`. Each message is either delivered or counted.
///
/// @threads  Safe.
template <typename T>
class WaitingMessages {
 public:
  /// `bell` wakes the serving thread.
  WaitingMessages(std::size_t depth, std::shared_ptr<Bell> bell)
      : depth_(depth), bell_(std::move(bell)) {}

  void add(T message) {
    const std::lock_guard lock(mutex_);
    waiting_.push_back(std::move(message));
    if (waiting_.size() > depth_) {
      waiting_.pop_front();
      overflowed_.fetch_add(1);
    }
  }
  /// Wakes the serving thread; once after several were added.
  void ring() { bell_->ring(); }
  /// All waiting messages, the oldest first.
  [[nodiscard]] std::deque<T> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(waiting_, {});
  }
  [[nodiscard]] std::uint64_t overflowed() const { return overflowed_.load(); }

 private:
  const std::size_t depth_;
  const std::shared_ptr<Bell> bell_;
  std::atomic<std::uint64_t> overflowed_{0};
  std::mutex mutex_;
  std::deque<T> waiting_;  // Guarded by it.
};

}  // namespace fastcycle::dds_gateway

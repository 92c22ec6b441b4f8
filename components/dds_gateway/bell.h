#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

namespace fastcycle::dds_gateway {

/// Wakes the thread that serves a participant.
///
/// @threads  Safe.
class Bell {
 public:
  void ring() {
    {
      const std::lock_guard lock(mutex_);
      has_rung_ = true;
    }
    rung_.notify_one();
  }
  /// Waits until it rings, or has rung since the last wait; at most for `timeout`.
  void wait(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    rung_.wait_for(lock, timeout, [this] { return has_rung_; });
    has_rung_ = false;
  }

 private:
  std::mutex mutex_;
  std::condition_variable rung_;
  bool has_rung_ = false;
};

}  // namespace fastcycle::dds_gateway

#pragma once

#include <pthread.h>

namespace fastcycle::base {

/// A mutex whose holder inherits the priority of who waits for it: for what running components and
/// threads of a lower priority share.
///
/// @threads  Safe. With `std::lock_guard` and `std::unique_lock`.
class PriorityMutex {
 public:
  PriorityMutex();
  PriorityMutex(const PriorityMutex&) = delete;
  PriorityMutex& operator=(const PriorityMutex&) = delete;
  ~PriorityMutex();
  void lock() noexcept;
  void unlock() noexcept;

 private:
  pthread_mutex_t mutex_;
};

}  // namespace fastcycle::base

#pragma once

#include <pthread.h>

namespace fastcycle::base {

/// A mutex with priority inheritance: for data that running components share with threads of a
/// lower priority.
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

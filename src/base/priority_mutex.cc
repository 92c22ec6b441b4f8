#include "base/priority_mutex.h"

namespace fastcycle::base {

PriorityMutex::PriorityMutex() {
  pthread_mutexattr_t attributes;
  pthread_mutexattr_init(&attributes);
  pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
  pthread_mutex_init(&mutex_, &attributes);
  pthread_mutexattr_destroy(&attributes);
}

PriorityMutex::~PriorityMutex() {
  pthread_mutex_destroy(&mutex_);
}

void PriorityMutex::lock() noexcept {
  pthread_mutex_lock(&mutex_);
}

void PriorityMutex::unlock() noexcept {
  pthread_mutex_unlock(&mutex_);
}

}  // namespace fastcycle::base

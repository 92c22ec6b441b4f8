#include "base/giving_way.h"

#include <cerrno>

#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

constexpr sched_param kNoPriority{};

/// The permission to come back is that for one step of niceness, which is taken back at once.
bool can_come_back() noexcept {
  errno = 0;
  const int nice = getpriority(PRIO_PROCESS, 0);  // Of this thread alone.
  if (errno != 0 || nice <= PRIO_MIN || setpriority(PRIO_PROCESS, 0, nice - 1) != 0) {
    return false;
  }
  setpriority(PRIO_PROCESS, 0, nice);
  return true;
}

}  // namespace

void GivingWay::adopt() noexcept {
  const int policy = sched_getscheduler(0);
  if ((policy == SCHED_OTHER || policy == SCHED_BATCH) && can_come_back()) {
    policy_ = policy;
    thread_ = gettid();
  }
}

void GivingWay::begin() noexcept {
  if (thread_ == 0 || is_hurried_) {
    return;
  }
  is_giving_way_ = sched_setscheduler(0, SCHED_IDLE, &kNoPriority) == 0;
  if (is_hurried_) {
    end();  // Whoever is in a hurry did not see it yet.
  }
}

void GivingWay::end() noexcept {
  if (is_giving_way_) {
    share();
    is_giving_way_ = false;
  }
}

void GivingWay::hurry(bool is_hurried) noexcept {
  is_hurried_ = is_hurried;
  if (is_hurried) {
    share();
  }
}

void GivingWay::share() const noexcept {
  // Not by way of pthread_setschedparam, which takes a lock that the thread itself may hold.
  if (const pid_t thread = thread_; thread != 0) {
    sched_setscheduler(thread, policy_, &kNoPriority);
  }
}

}  // namespace fastcycle::base

#include "base/priority.h"

#include <algorithm>
#include <cstdint>

#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

/// Of `sched_setattr`, which the C library does not have; see sched(7).
struct SchedulingAttributes {
  std::uint32_t size;
  std::uint32_t policy;
  std::uint64_t flags;
  std::int32_t nice;
  std::uint32_t priority;
  std::uint64_t runtime_ns;
  std::uint64_t deadline_ns;
  std::uint64_t period_ns;
};

}  // namespace

bool set_time_slice(std::chrono::nanoseconds slice) noexcept {
  const auto slice_ns = static_cast<std::uint64_t>(slice.count());
  SchedulingAttributes attributes{.size = sizeof(SchedulingAttributes),
                                  .policy = SCHED_OTHER,
                                  .flags = 0,
                                  .nice = ::getpriority(PRIO_PROCESS, 0),  // Of this thread alone.
                                  .priority = 0,
                                  .runtime_ns = slice_ns,
                                  .deadline_ns = 0,
                                  .period_ns = 0};
  // Systems without slices ignore them, or return an error.
  return ::syscall(SYS_sched_setattr, 0, &attributes, 0) == 0 &&
         ::syscall(SYS_sched_getattr, 0, &attributes, sizeof(attributes), 0) == 0 &&
         attributes.runtime_ns == slice_ns;
}

void give_way() noexcept {
  constexpr int kNice = 10;
  constexpr std::chrono::milliseconds kSlice{10};  // Others have 0.7 to 3 ms, unless they ask.
  const int nice = std::max(kNice, ::getpriority(PRIO_PROCESS, 0));  // Of this thread alone.
  static_cast<void>(::setpriority(PRIO_PROCESS, 0, nice));
  static_cast<void>(set_time_slice(kSlice));
}

}  // namespace fastcycle::base

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

void give_way() noexcept {
  constexpr int kNice = 10;
  constexpr std::uint64_t kSliceNs = 10'000'000;  // Others have 0.7 to 3 ms, unless they ask.
  const int nice = std::max(kNice, ::getpriority(PRIO_PROCESS, 0));  // Of this thread alone.
  static_cast<void>(::setpriority(PRIO_PROCESS, 0, nice));
  const SchedulingAttributes attributes{.size = sizeof(SchedulingAttributes),
                                        .policy = SCHED_OTHER,
                                        .flags = 0,
                                        .nice = nice,
                                        .priority = 0,
                                        .runtime_ns = kSliceNs,
                                        .deadline_ns = 0,
                                        .period_ns = 0};
  // Systems without slices ignore them, or return an error.
  static_cast<void>(::syscall(SYS_sched_setattr, 0, &attributes, 0));
}

}  // namespace fastcycle::base

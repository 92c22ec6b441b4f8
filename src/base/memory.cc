#include "base/memory.h"

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>

#include <linux/capability.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

bool may_lock_without_limit() noexcept {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY) {
    return true;
  }
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  __user_cap_data_struct data[_LINUX_CAPABILITY_U32S_3] = {};
  return syscall(SYS_capget, &header, data) == 0 &&
         (data[0].effective & (std::uint32_t{1} << CAP_IPC_LOCK)) != 0;
}

/// Whether more than the limit may be locked: in a user namespace of its own, as in a rootless
/// container, a process has the capability without its effect. Once all that is mapped is locked.
bool is_limit_in_force() noexcept {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
    return false;
  }
  void* probe = mmap(nullptr, limit.rlim_cur + 1, PROT_NONE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (probe == MAP_FAILED) {
    return errno == EAGAIN;
  }
  munmap(probe, limit.rlim_cur + 1);
  return false;
}

Refusal refusal(const std::string& why) {
  return {"memory that stays in memory, for real-time executors: " + why,
          "grant it with a line `@realtime - memlock unlimited` in /etc/security/limits.conf for a "
          "group of yours, or with `LimitMEMLOCK=infinity` in the unit of a service"};
}

}  // namespace

std::optional<Refusal> lock_memory_as_touched() {
  if (!may_lock_without_limit()) {
    return refusal("the limit on locked memory (`ulimit -l`) could be reached while running");
  }
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0) {
    return refusal(std::strerror(errno));
  }
  if (is_limit_in_force()) {
    munlockall();
    return refusal("the limit on locked memory (`ulimit -l`) holds, whatever the capability says");
  }
  return std::nullopt;
}

}  // namespace fastcycle::base

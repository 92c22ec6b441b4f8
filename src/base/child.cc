#include "base/child.h"

#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::base {

int open_child(pid_t child) noexcept {
  return static_cast<int>(syscall(SYS_pidfd_open, child, 0));
}

bool has_ended(pid_t child) noexcept {
  siginfo_t end{};
  return waitid(P_PID, static_cast<id_t>(child), &end, WEXITED | WNOHANG | WNOWAIT) == 0 &&
         end.si_pid == child;
}

}  // namespace fastcycle::base

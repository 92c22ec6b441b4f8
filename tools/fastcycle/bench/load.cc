#include "bench/load.h"

#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <string>

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::tool::bench {
namespace {

[[noreturn]] void be_busy(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) {
    _exit(0);  // It ended before the line above.
  }
  volatile bool is_busy = true;
  while (is_busy) {
  }
  _exit(0);
}

}  // namespace

Load::Load(std::int64_t count) {
  const pid_t parent = getpid();
  for (std::int64_t i = 0; i < count; ++i) {
    const pid_t child = fork();
    if (child == 0) {
      be_busy(parent);
    }
    if (child < 0) {
      throw std::runtime_error(std::string("--load: cannot create a process: ") +
                               std::strerror(errno));
    }
    processes_.push_back(child);
  }
}

Load::~Load() {
  for (const pid_t process : processes_) {
    kill(process, SIGKILL);
  }
  for (const pid_t process : processes_) {
    while (waitpid(process, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
}

}  // namespace fastcycle::tool::bench

#include "base/memory.h"

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

/// KiB of this process that are locked in memory.
long locked_kib() {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    if (word == "VmLck:") {
      long kib = 0;
      status >> kib;
      return kib;
    }
  }
  return -1;
}

/// Runs `body` in a child, whose memory this process does not share; its exit status.
template <typename Body>
int in_child(const Body& body) {
  const pid_t child = fork();
  if (child == 0) {
    _exit(body());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(Memory, IsLockedOrTheMachineSaysWhyNot) {
  const int status = in_child([] {
    const auto refused = lock_memory_as_touched();
    if (refused) {
      return refused->what.empty() || refused->remedy.empty() ? 1 : 0;
    }
    return locked_kib() > 0 ? 0 : 2;
  });

  EXPECT_EQ(status, 0);
}

TEST(Memory, IsNotLockedUnderALimitThatCouldBeReachedLater) {
  const int status = in_child([] {
    const rlimit small{.rlim_cur = 8 << 20, .rlim_max = 8 << 20};
    if (setrlimit(RLIMIT_MEMLOCK, &small) != 0 || (getuid() == 0 && setuid(65534) != 0)) {
      return 77;
    }
    return lock_memory_as_touched() && locked_kib() == 0 ? 0 : 1;
  });

  if (status == 77) {
    GTEST_SKIP() << "this process may not lower its own rights";
  }
  EXPECT_EQ(status, 0);
}

}  // namespace
}  // namespace fastcycle::base

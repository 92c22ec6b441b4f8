#include "base/memory.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mman.h>
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
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's mlockall does nothing";
#endif
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

// Root of a user namespace of its own, as in a rootless container, has the right by name only.
TEST(Memory, IsNotLockedByARightThatHoldsInItsOwnNamespaceOnly) {
  static constexpr rlim_t kLimit = rlim_t{1} << 30;
  const int status = in_child([] {
    rlimit limit{};
    const bool may_try = getrlimit(RLIMIT_MEMLOCK, &limit) == 0 &&
                         (limit.rlim_cur = limit.rlim_max = std::min(limit.rlim_max, kLimit),
                          setrlimit(RLIMIT_MEMLOCK, &limit) == 0) &&
                         (getuid() != 0 || setuid(65534) == 0) && unshare(CLONE_NEWUSER) == 0;
    if (!may_try) {
      return 77;
    }
    if (lock_memory_as_touched()) {
      return locked_kib() == 0 ? 0 : 1;
    }
    // Then nothing may run into the limit.
    return mmap(nullptr, 2 * kLimit, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED
               ? 2
               : 0;
  });

  if (status == 77) {
    GTEST_SKIP() << "this process may not make a user namespace";
  }
  EXPECT_EQ(status, 0);
}

}  // namespace
}  // namespace fastcycle::base

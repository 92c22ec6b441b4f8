#include "base/child.h"

#include <csignal>

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

TEST(Child, HasEndedOnceItsProcessHasAndCanStillBeWaitedFor) {
  const pid_t child = fork();
  if (child == 0) {
    pause();
    _exit(0);
  }
  EXPECT_FALSE(has_ended(child));
  kill(child, SIGKILL);
  while (!has_ended(child)) {
    usleep(1000 * kLookAgainMs);
  }
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_FALSE(has_ended(child)) << "it is no child any more";
}

TEST(Child, HasADescriptorThatIsReadableAtItsEnd) {
  const pid_t child = fork();
  if (child == 0) {
    pause();
    _exit(0);
  }
  pollfd end = {open_child(child), POLLIN, 0};
  if (end.fd < 0) {
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    GTEST_SKIP() << "no pidfd_open here: Linux before 5.3, or valgrind";
  }
  EXPECT_EQ(poll(&end, 1, 0), 0);
  kill(child, SIGKILL);
  EXPECT_EQ(poll(&end, 1, -1), 1);
  waitpid(child, nullptr, 0);
  close(end.fd);
}

}  // namespace
}  // namespace fastcycle::base

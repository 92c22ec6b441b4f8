#include "sandbox/filter.h"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <initializer_list>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/audit.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include "sandbox/call_names.h"

namespace fastcycle::sandbox {
namespace {

constexpr int kOwn = 4711;
constexpr std::uint64_t kHigh = std::uint64_t{1} << 32;

#if defined(__x86_64__)
constexpr std::uint32_t kHere = AUDIT_ARCH_X86_64;
constexpr std::uint32_t kElsewhere = AUDIT_ARCH_I386;
#else
constexpr std::uint32_t kHere = AUDIT_ARCH_AARCH64;
constexpr std::uint32_t kElsewhere = AUDIT_ARCH_ARM;
#endif

/// What the kernel would decide, and how many instructions that takes.
struct Judged {
  std::uint32_t decision = 0;
  std::size_t instructions = 0;
};

/// Executes the instructions that the filter has, as the kernel does; others fail the test.
Judged judge(const std::vector<sock_filter>& program, const seccomp_data& call) {
  std::uint32_t accumulator = 0;
  Judged judged;
  for (std::size_t at = 0; at < program.size(); ++at) {
    const sock_filter& now = program[at];
    ++judged.instructions;
    const auto jump = [&](bool is_true) { at += is_true ? now.jt : now.jf; };
    switch (now.code) {
      case BPF_LD | BPF_W | BPF_ABS:
        std::memcpy(&accumulator, reinterpret_cast<const char*>(&call) + now.k,
                    sizeof(accumulator));
        break;
      case BPF_ALU | BPF_AND | BPF_K:
        accumulator &= now.k;
        break;
      case BPF_JMP | BPF_JEQ | BPF_K:
        jump(accumulator == now.k);
        break;
      case BPF_JMP | BPF_JGT | BPF_K:
        jump(accumulator > now.k);
        break;
      case BPF_JMP | BPF_JSET | BPF_K:
        jump((accumulator & now.k) != 0);
        break;
      case BPF_RET | BPF_K:
        judged.decision = now.k;
        return judged;
      default:
        ADD_FAILURE() << "instruction " << now.code;
        return judged;
    }
  }
  ADD_FAILURE() << "the program has no end";
  return judged;
}

std::uint32_t decide(int call, std::initializer_list<std::uint64_t> arguments = {},
                     bool may_load_code = false, std::uint32_t architecture = kHere) {
  seccomp_data data{};
  data.nr = call;
  data.arch = architecture;
  std::ranges::copy(arguments, data.args);
  return judge(filter_program(may_load_code, kOwn), data).decision;
}

bool is_allowed(int call, std::initializer_list<std::uint64_t> arguments = {},
                bool may_load_code = false) {
  return decide(call, arguments, may_load_code) == SECCOMP_RET_ALLOW;
}

bool is_trapped(int call, std::initializer_list<std::uint64_t> arguments = {},
                bool may_load_code = false) {
  return (decide(call, arguments, may_load_code) & SECCOMP_RET_ACTION_FULL) == SECCOMP_RET_TRAP;
}

TEST(Filter, EachCallThatIsRefusedByNumberHasAName) {
#if defined(__x86_64__)
  constexpr int kGap = 335;  // Up to 423 there are none.
#else
  constexpr int kGap = 295;
#endif
  for (int call = 0; call <= kLastKnownCall; ++call) {
    const bool is_call = call < kGap || call > 423;
    // Numbers that arm64 keeps free for calls of single architectures.
    const bool is_free = kGap == 295 && call >= 244 && call < 260;
    if (is_call && !is_free && decide(call) == SECCOMP_RET_TRAP) {
      EXPECT_NE(name_of_call(call), nullptr) << call;
    }
  }
}

TEST(Filter, AThreadIsMadeAndAProcessIsNot) {
  const std::uint64_t thread = CLONE_VM | CLONE_FS | CLONE_FILES | CLONE_SIGHAND | CLONE_THREAD |
                               CLONE_SYSVSEM | CLONE_SETTLS | CLONE_PARENT_SETTID |
                               CLONE_CHILD_CLEARTID;
  EXPECT_TRUE(is_allowed(SYS_clone, {thread}));
  EXPECT_TRUE(is_trapped(SYS_clone, {SIGCHLD}));
  EXPECT_TRUE(is_trapped(SYS_clone, {thread | CLONE_NEWNET}));
  EXPECT_TRUE(is_trapped(SYS_clone, {CLONE_NEWUSER | SIGCHLD}));
  EXPECT_EQ(decide(SYS_clone, {CLONE_VM | CLONE_VFORK | SIGCHLD}),
            static_cast<std::uint32_t>(SECCOMP_RET_ERRNO | EPERM));
  EXPECT_EQ(decide(SYS_clone, {CLONE_CHILD_SETTID | CLONE_CHILD_CLEARTID | SIGCHLD}),
            static_cast<std::uint32_t>(SECCOMP_RET_ERRNO | EPERM));
  EXPECT_EQ(decide(435), static_cast<std::uint32_t>(SECCOMP_RET_ERRNO | ENOSYS));
}

TEST(Filter, MemoryIsNeverMadeExecutable) {
  for (const int call : {SYS_mmap, SYS_mprotect}) {
    EXPECT_TRUE(is_allowed(call, {0, 4096, PROT_READ | PROT_WRITE}));
    EXPECT_TRUE(is_trapped(call, {0, 4096, PROT_READ | PROT_EXEC}));
    EXPECT_TRUE(is_trapped(call, {0, 4096, PROT_READ | PROT_WRITE | PROT_EXEC}));
  }
}

TEST(Filter, MemoryIsMadeExecutableOrWritableWhereCodeMayBeLoaded) {
  for (const int call : {SYS_mmap, SYS_mprotect}) {
    EXPECT_TRUE(is_allowed(call, {0, 4096, PROT_READ | PROT_WRITE}, true));
    EXPECT_TRUE(is_allowed(call, {0, 4096, PROT_READ | PROT_EXEC}, true));
    EXPECT_TRUE(is_trapped(call, {0, 4096, PROT_READ | PROT_WRITE | PROT_EXEC}, true));
  }
}

TEST(Filter, SignalsGoToTheProcessItself) {
  for (const int call : {SYS_kill, SYS_tgkill, SYS_rt_sigqueueinfo, SYS_rt_tgsigqueueinfo}) {
    EXPECT_TRUE(is_allowed(call, {kOwn}));
    EXPECT_TRUE(is_trapped(call, {kOwn + 1}));
    EXPECT_TRUE(is_trapped(call, {0}));
    EXPECT_TRUE(is_trapped(call, {static_cast<std::uint64_t>(-kOwn)}));
    EXPECT_TRUE(is_trapped(call, {~std::uint64_t{0}}));
  }
}

TEST(Filter, TheHandlerOfRefusalsIsAskedForAndNotReplaced) {
  EXPECT_TRUE(is_allowed(SYS_rt_sigaction, {SIGSEGV, 1}));
  EXPECT_TRUE(is_allowed(SYS_rt_sigaction, {SIGSYS, 0}));
  EXPECT_TRUE(is_trapped(SYS_rt_sigaction, {SIGSYS, 1}));
  EXPECT_TRUE(is_trapped(SYS_rt_sigaction, {SIGSYS, kHigh}));
}

TEST(Filter, LimitsAreReadAndNotSet) {
  EXPECT_TRUE(is_allowed(SYS_prlimit64, {0, 7, 0, 1}));
  EXPECT_TRUE(is_allowed(SYS_prlimit64, {kOwn, 7, 0, 1}));
  EXPECT_TRUE(is_trapped(SYS_prlimit64, {1, 7, 0, 1}));
  EXPECT_TRUE(is_trapped(SYS_prlimit64, {0, 7, 1, 0}));
  EXPECT_TRUE(is_trapped(SYS_prlimit64, {0, 7, kHigh, 0}));
}

TEST(Filter, AThreadPlacesItselfAndNobodyElse) {
  for (const int call :
       {SYS_sched_setaffinity, SYS_sched_setscheduler, SYS_sched_setparam, SYS_sched_setattr}) {
    EXPECT_TRUE(is_allowed(call, {0}));
    EXPECT_TRUE(is_allowed(call, {kOwn}));
    EXPECT_EQ(decide(call, {1}), static_cast<std::uint32_t>(SECCOMP_RET_ERRNO | EPERM));
  }
}

TEST(Filter, AFileIsNotEmptiedByBeingOpenedForReading) {
  EXPECT_TRUE(is_allowed(SYS_openat, {0, 0, O_RDONLY | O_CLOEXEC}));
  EXPECT_TRUE(is_allowed(SYS_openat, {0, 0, O_WRONLY | O_CREAT | O_TRUNC}));
  EXPECT_TRUE(is_trapped(SYS_openat, {0, 0, O_RDONLY | O_TRUNC}));
}

TEST(Filter, UpperHalvesOfArgumentsThatTheKernelIgnoresChangeNothing) {
  EXPECT_TRUE(is_trapped(SYS_prctl, {kHigh | PR_SET_DUMPABLE, 1}));
  EXPECT_TRUE(is_allowed(SYS_prctl, {kHigh | PR_SET_NAME, 1}));
  EXPECT_TRUE(is_trapped(SYS_mmap, {0, 4096, kHigh | PROT_EXEC}));
  EXPECT_TRUE(is_trapped(SYS_clone, {kHigh | SIGCHLD}));
}

TEST(Filter, CallsOfAnotherArchitectureAreRefused) {
  EXPECT_EQ(decide(SYS_futex, {}, false, kElsewhere) & SECCOMP_RET_ACTION_FULL,
            static_cast<std::uint32_t>(SECCOMP_RET_TRAP));
#if defined(__x86_64__)
  EXPECT_TRUE(is_trapped(0x40000000 | SYS_futex));
#endif
}

TEST(Filter, WhatLaterKernelsHaveDoesNotExist) {
  EXPECT_EQ(decide(kLastKnownCall + 1), static_cast<std::uint32_t>(SECCOMP_RET_ERRNO | ENOSYS));
  EXPECT_NE(decide(-1), static_cast<std::uint32_t>(SECCOMP_RET_ALLOW));
}

TEST(Filter, WakingAndSleepingIsDecidedFirst) {
  seccomp_data data{};
  data.nr = SYS_futex;
  data.arch = kHere;

  const Judged judged = judge(filter_program(false, kOwn), data);

  EXPECT_EQ(judged.decision, static_cast<std::uint32_t>(SECCOMP_RET_ALLOW));
  EXPECT_LE(judged.instructions, 6u);
}

}  // namespace
}  // namespace fastcycle::sandbox

#include "sandbox/filter.h"

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <utility>

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "fastcycle/assert.h"
#include "sandbox/call_names.h"
#include "sandbox/refusals.h"

namespace fastcycle::sandbox {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#endif

// Needed by a computing component, with any arguments. The most frequent ones come first, for
// kernels without a cache of filter results.
constexpr int kAllowed[] = {
    // waiting, waking and time
    SYS_futex,
    SYS_clock_gettime,
    SYS_clock_nanosleep,
    SYS_read,
    SYS_write,
    SYS_gettid,
    SYS_getpid,
    SYS_sched_yield,
    SYS_nanosleep,
    SYS_gettimeofday,
    SYS_clock_getres,
    SYS_timerfd_settime,
    SYS_timerfd_gettime,
    SYS_timerfd_create,
    SYS_timer_create,
    SYS_timer_settime,
    SYS_timer_gettime,
    SYS_timer_getoverrun,
    SYS_timer_delete,
    SYS_setitimer,
    SYS_getitimer,
    SYS_eventfd2,
    SYS_ppoll,
    SYS_pselect6,
    SYS_epoll_create1,
    SYS_epoll_ctl,
    SYS_epoll_pwait,
    441 /* epoll_pwait2 */,
    449 /* futex_waitv */,
    454 /* futex_wake */,
    455 /* futex_wait */,
    456 /* futex_requeue */,
    SYS_restart_syscall,
    // memory
    SYS_munmap,
    SYS_brk,
    SYS_mremap,
    SYS_madvise,
    SYS_mincore,
    SYS_msync,
    SYS_mlock,
    SYS_mlock2,
    SYS_munlock,
    SYS_mlockall,
    SYS_munlockall,
    SYS_membarrier,
    SYS_mbind,
    SYS_set_mempolicy,
    SYS_get_mempolicy,
    462 /* mseal */,
    // threads and signals
    SYS_exit,
    SYS_exit_group,
    SYS_set_tid_address,
    SYS_set_robust_list,
    SYS_rseq,
    SYS_rt_sigreturn,
    SYS_rt_sigprocmask,
    SYS_rt_sigpending,
    SYS_rt_sigsuspend,
    SYS_rt_sigtimedwait,
    SYS_sigaltstack,
    SYS_signalfd4,
    SYS_sched_getaffinity,
    SYS_sched_getparam,
    SYS_sched_getscheduler,
    SYS_sched_getattr,
    SYS_sched_get_priority_max,
    SYS_sched_get_priority_min,
    SYS_sched_rr_get_interval,
    SYS_getpriority,
    SYS_getcpu,
    // information on the process and the machine
    SYS_getppid,
    SYS_getpgid,
    SYS_getsid,
    SYS_getuid,
    SYS_geteuid,
    SYS_getgid,
    SYS_getegid,
    SYS_getresuid,
    SYS_getresgid,
    SYS_getgroups,
    SYS_capget,
    SYS_getrusage,
    SYS_getrlimit,
    SYS_times,
    SYS_uname,
    SYS_sysinfo,
    SYS_getrandom,
    SYS_umask,
    // open descriptors
    SYS_close,
    436 /* close_range */,
    SYS_dup,
    SYS_dup3,
    SYS_pipe2,
    SYS_lseek,
    SYS_pread64,
    SYS_pwrite64,
    SYS_readv,
    SYS_writev,
    SYS_preadv,
    SYS_pwritev,
    SYS_preadv2,
    SYS_pwritev2,
    SYS_sendfile,
    SYS_copy_file_range,
    SYS_fstat,
    SYS_ftruncate,
    SYS_fallocate,
    SYS_fsync,
    SYS_fdatasync,
    SYS_sync_file_range,
    SYS_fadvise64,
    SYS_readahead,
    SYS_flock,
    SYS_getdents64,
    SYS_fstatfs,
    SYS_fgetxattr,
    SYS_flistxattr,
    // files, checked by Landlock; it lets everyone see that a file exists
    SYS_newfstatat,
    SYS_statx,
    SYS_faccessat,
    439 /* faccessat2 */,
    SYS_readlinkat,
    SYS_statfs,
    SYS_getcwd,
    SYS_chdir,
    SYS_fchdir,
    SYS_mkdirat,
    SYS_unlinkat,
    SYS_linkat,
    SYS_renameat2,
    SYS_getxattr,
    SYS_lgetxattr,
    SYS_listxattr,
    SYS_llistxattr,
#if defined(__x86_64__)
    SYS_poll,
    SYS_select,
    SYS_epoll_wait,
    SYS_epoll_create,
    SYS_eventfd,
    SYS_signalfd,
    SYS_time,
    SYS_alarm,
    SYS_pause,
    SYS_getpgrp,
    SYS_dup2,
    SYS_pipe,
    SYS_getdents,
    SYS_creat,
    SYS_stat,
    SYS_lstat,
    SYS_access,
    SYS_readlink,
    SYS_mkdir,
    SYS_rmdir,
    SYS_unlink,
    SYS_link,
    SYS_rename,
    SYS_renameat,
#endif
};

// Permitted changes of the process itself. Excluded: to become dumpable, to outlive its parent, to
// trace, to change the filter.
constexpr std::uint32_t kPrctls[] = {PR_SET_NAME,         PR_GET_NAME,        PR_SET_TIMERSLACK,
                                     PR_GET_TIMERSLACK,   PR_GET_DUMPABLE,    PR_GET_NO_NEW_PRIVS,
                                     PR_GET_SECCOMP,      PR_GET_PDEATHSIG,   PR_CAPBSET_READ,
                                     PR_SET_NO_NEW_PRIVS, PR_SET_THP_DISABLE, PR_GET_THP_DISABLE,
                                     0x53564d41 /* PR_SET_VMA: names of mappings */};

// For any file, and terminal queries.
constexpr std::uint32_t kIoctls[] = {FIONREAD, FIONBIO, FIOCLEX, FIONCLEX, TCGETS, TIOCGWINSZ};

// Excluded: those that send signals to others.
constexpr std::uint32_t kFcntls[] = {F_DUPFD,
                                     F_DUPFD_CLOEXEC,
                                     F_GETFD,
                                     F_SETFD,
                                     F_GETFL,
                                     F_SETFL,
                                     F_GETLK,
                                     F_SETLK,
                                     F_SETLKW,
                                     36 /* F_OFD_GETLK */,
                                     37 /* F_OFD_SETLK */,
                                     38 /* F_OFD_SETLKW */,
                                     1031 /* F_SETPIPE_SZ */,
                                     1032 /* F_GETPIPE_SZ */,
                                     1033 /* F_ADD_SEALS */,
                                     1034 /* F_GET_SEALS */};

constexpr std::uint32_t kAllow = SECCOMP_RET_ALLOW;

constexpr std::uint32_t refuse(Rule rule) {
  return SECCOMP_RET_TRAP | static_cast<std::uint32_t>(rule);
}

/// For calls that the C library makes with all signals blocked, where a signal would end the
/// process.
constexpr std::uint32_t fail(int error) {
  return SECCOMP_RET_ERRNO | static_cast<std::uint32_t>(error);
}

/// Builds a program call by call. The number of the call is in the accumulator between blocks: each
/// block ends with a decision.
class Program {
 public:
  Program() {
    add(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, arch));
    if_not_equal(kArchitecture, refuse(Rule::kForeignArchitecture));
    add(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr));
#if defined(__x86_64__)
    constexpr std::uint32_t kX32 = 0x40000000;
    if_any_bit(kX32, refuse(Rule::kForeignArchitecture));
#endif
  }

  void decide(std::uint32_t decision) { add(BPF_RET | BPF_K, decision); }

  void allow(int call) { if_equal(static_cast<std::uint32_t>(call), kAllow); }

  /// Begins the block of one call.
  void begin(int call) {
    block_ = code_.size();
    add(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call));
  }

  /// Ends the block with the default decision.
  void end(std::uint32_t decision) {
    decide(decision);
    const std::size_t distance = code_.size() - block_ - 1;
    FASTCYCLE_ASSERT(distance <= UINT8_MAX, "a jump of a filter is that long at most");
    code_[block_].jf = static_cast<std::uint8_t>(distance);
  }

  /// Loads 32 bits of an argument.
  void argument(unsigned index) {
    add(BPF_LD | BPF_W | BPF_ABS,
        static_cast<std::uint32_t>(offsetof(seccomp_data, args) + 8 * index));
  }
  void upper_argument(unsigned index) {
    add(BPF_LD | BPF_W | BPF_ABS,
        static_cast<std::uint32_t>(offsetof(seccomp_data, args) + 8 * index + 4));
  }
  void mask(std::uint32_t bits) { add(BPF_ALU | BPF_AND | BPF_K, bits); }

  void if_equal(std::uint32_t value, std::uint32_t decision) {
    add(BPF_JMP | BPF_JEQ | BPF_K, value, 0, 1);
    decide(decision);
  }
  void if_not_equal(std::uint32_t value, std::uint32_t decision) {
    add(BPF_JMP | BPF_JEQ | BPF_K, value, 1, 0);
    decide(decision);
  }
  void if_any_bit(std::uint32_t bits, std::uint32_t decision) {
    add(BPF_JMP | BPF_JSET | BPF_K, bits, 0, 1);
    decide(decision);
  }
  void if_above(std::uint32_t value, std::uint32_t decision) {
    add(BPF_JMP | BPF_JGT | BPF_K, value, 0, 1);
    decide(decision);
  }

  /// A whole block: allows the call if an argument is one of these values.
  template <typename Values>
  void allow_values(int call, unsigned index, const Values& values, std::uint32_t otherwise) {
    begin(call);
    argument(index);
    for (const std::uint32_t value : values) {
      if_equal(value, kAllow);
    }
    end(otherwise);
  }

  [[nodiscard]] std::vector<sock_filter> take() { return std::move(code_); }

 private:
  void add(unsigned code, std::uint32_t value, std::uint8_t if_true = 0,
           std::uint8_t if_false = 0) {
    code_.push_back({static_cast<std::uint16_t>(code), if_true, if_false, value});
  }

  std::vector<sock_filter> code_;
  std::size_t block_ = 0;
};

/// Allows new threads, but no processes.
void add_clone(Program& program) {
  constexpr std::uint32_t kNamespaces = CLONE_NEWNS | CLONE_NEWCGROUP | CLONE_NEWUTS |
                                        CLONE_NEWIPC | CLONE_NEWUSER | CLONE_NEWPID | CLONE_NEWNET |
                                        CLONE_PTRACE;
  program.begin(SYS_clone);
  program.argument(0);
  program.if_any_bit(kNamespaces, refuse(Rule::kNamespace));
  program.if_any_bit(CLONE_THREAD, kAllow);  // The kernel requires the related flags.
  // By `posix_spawn` and `fork` of the C library, which may hold SIGSYS back meanwhile: a signal
  // would end the process. Our replacements of both report it.
  program.if_any_bit(CLONE_VFORK | CLONE_CHILD_SETTID, fail(EPERM));
  program.end(refuse(Rule::kFork));
  // Its flags are in memory, which the filter cannot read. The C library falls back to `clone`.
  program.begin(435 /* clone3 */);
  program.end(fail(ENOSYS));
}

/// Memory never becomes executable, or never while it is writable.
void add_memory(Program& program, bool may_load_code) {
  for (const int call : {SYS_mmap, SYS_mprotect}) {
    program.begin(call);
    program.argument(2);
    if (may_load_code) {
      program.mask(PROT_WRITE | PROT_EXEC);
      program.if_equal(PROT_WRITE | PROT_EXEC, refuse(Rule::kExecutable));
    } else {
      program.if_any_bit(PROT_EXEC, refuse(Rule::kExecutable));
    }
    program.end(kAllow);
  }
  constexpr std::uint32_t kExecutableFile = 0x10;  // MFD_EXEC
  program.begin(SYS_memfd_create);
  program.argument(1);
  program.if_any_bit(kExecutableFile, refuse(Rule::kExecutableFile));
  program.end(kAllow);
}

/// Signals may be sent only to the process itself.
void add_signals(Program& program, std::uint32_t own) {
  for (const int call : {SYS_kill, SYS_tgkill, SYS_rt_sigqueueinfo, SYS_rt_tgsigqueueinfo}) {
    program.allow_values(call, 0, std::array{own}, refuse(Rule::kForeignSignal));
  }
  // Queries of the present handler are allowed.
  program.begin(SYS_rt_sigaction);
  program.argument(0);
  program.if_not_equal(SIGSYS, kAllow);
  program.argument(1);
  program.if_not_equal(0, refuse(Rule::kSigsysHandler));
  program.upper_argument(1);
  program.if_not_equal(0, refuse(Rule::kSigsysHandler));
  program.end(kAllow);
}

/// A thread may set its own CPUs and policy: the filter cannot distinguish other threads of the
/// process from those of other processes.
void add_scheduling(Program& program, std::uint32_t own) {
  for (const int call :
       {SYS_sched_setaffinity, SYS_sched_setscheduler, SYS_sched_setparam, SYS_sched_setattr}) {
    program.allow_values(call, 0, std::array{std::uint32_t{0}, own}, fail(EPERM));
  }
  program.begin(SYS_setpriority);
  program.argument(0);
  program.if_not_equal(0 /* PRIO_PROCESS */, refuse(Rule::kForeignPriority));
  program.argument(1);
  program.if_equal(0, kAllow);
  program.if_equal(own, kAllow);
  program.end(refuse(Rule::kForeignPriority));
}

void add_limits(Program& program, std::uint32_t own) {
  program.begin(SYS_prlimit64);
  program.argument(2);
  program.if_not_equal(0, refuse(Rule::kForeignLimits));
  program.upper_argument(2);
  program.if_not_equal(0, refuse(Rule::kForeignLimits));
  program.argument(0);
  program.if_equal(0, kAllow);
  program.if_equal(own, kAllow);
  program.end(refuse(Rule::kForeignLimits));
}

/// Landlock checks which files are opened. Old versions do not check truncation by opening for
/// reading.
void add_files(Program& program) {
  const auto add_open = [&](int call, unsigned flags) {
    program.begin(call);
    program.argument(flags);
    program.mask(O_ACCMODE | O_TRUNC);
    program.if_equal(O_RDONLY | O_TRUNC, refuse(Rule::kTruncate));
    program.end(kAllow);
  };
  add_open(SYS_openat, 2);
#if defined(__x86_64__)
  add_open(SYS_open, 1);
#endif
  // Its flags are in memory. Its users fall back for kernels without it.
  program.begin(437 /* openat2 */);
  program.end(fail(ENOSYS));
}

base::Refusal without_filters(const std::string& what) {
  return {"the sandbox: " + what,
          "run a kernel that is built with CONFIG_SECCOMP_FILTER, and where a container is around, "
          "let it allow seccomp; or give the process no sandbox"};
}

}  // namespace

std::vector<sock_filter> filter_program(bool may_load_code, int own) {
  const auto process = static_cast<std::uint32_t>(own);
  Program program;
  for (const int call : kAllowed) {
    program.allow(call);
  }
  add_files(program);
  add_memory(program, may_load_code);
  add_clone(program);
  add_signals(program, process);
  add_scheduling(program, process);
  add_limits(program, process);
  program.allow_values(SYS_prctl, 0, kPrctls, refuse(Rule::kRequest));
  program.allow_values(SYS_ioctl, 1, kIoctls, refuse(Rule::kRequest));
  program.allow_values(SYS_fcntl, 1, kFcntls, refuse(Rule::kRequest));
#if defined(__x86_64__)
  // Requests for AMX registers.
  program.allow_values(SYS_arch_prctl, 0, std::array<std::uint32_t, 3>{0x1021, 0x1022, 0x1023},
                       refuse(Rule::kRequest));
#endif
  program.if_above(kLastKnownCall, fail(ENOSYS));
  program.decide(refuse(Rule::kCall));
  return program.take();
}

std::optional<base::Refusal> check_filter() {
  for (const std::uint32_t action : {SECCOMP_RET_TRAP, SECCOMP_RET_ERRNO}) {
    if (syscall(SYS_seccomp, SECCOMP_GET_ACTION_AVAIL, 0, &action) != 0) {
      return without_filters(std::string("system calls cannot be filtered here: ") +
                             std::strerror(errno));
    }
  }
  return std::nullopt;
}

std::optional<base::Refusal> install_filter(bool may_load_code) {
  std::vector<sock_filter> code = filter_program(may_load_code, getpid());
  const sock_fprog program{static_cast<unsigned short>(code.size()), code.data()};
  // For all threads. There is one, see `apply_sandbox`.
  const long result =
      syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program);
  if (result != 0) {
    return without_filters(std::string("the filter of system calls is not in force: ") +
                           (result < 0 ? std::strerror(errno) : "a thread refused it"));
  }
  return std::nullopt;
}

}  // namespace fastcycle::sandbox

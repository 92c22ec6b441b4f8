// What a hostile component would try, each on a child process that has applied the sandbox.

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string_view>

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/inotify.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include "sandbox/refusals.h"
#include "sandbox/sandbox.h"
#include "sandbox/test_child.h"

namespace fastcycle::sandbox {
namespace {

/// What the actions aim at.
struct Target {
  std::filesystem::path folder;    ///< May be written.
  std::filesystem::path readable;  ///< A file that may be read.
  std::filesystem::path outside;   ///< A folder that nobody named.
  pid_t parent = 0;
};

/// Whether the call of a process or thread of its own was refused; one that was made ends at once.
bool is_no_process(long result) {
  if (result == 0) {
    _exit(0);
  }
  if (result > 0) {
    int status = 0;
    waitpid(static_cast<pid_t>(result), &status, __WALL);
  }
  return result < 0 && (errno == EPERM || errno == ENOSYS);
}

bool is_refused(long result) {
  return result < 0 && (errno == EPERM || errno == EACCES || errno == ENOSYS || errno == EXDEV);
}

bool is_refused(const void* result) {
  return result == MAP_FAILED && errno == EPERM;
}

struct Action {
  const char* name;
  const char*
      reported;  ///< How the refusal is reported; empty: the file system refuses it by itself.
  bool (*is_refused)(const Target& target);
};

long open_for(const std::filesystem::path& path, int flags) {
  return open(path.c_str(), flags | O_CLOEXEC, 0600);
}

constexpr std::array kActions{
    // Others by the network, and on this machine
    Action{"connect to the network", "socket",
           [](const Target&) { return is_refused(socket(AF_INET, SOCK_STREAM, 0)); }},
    Action{"send datagrams", "socket",
           [](const Target&) { return is_refused(socket(AF_INET6, SOCK_DGRAM, 0)); }},
    Action{"read all packets", "socket",
           [](const Target&) { return is_refused(socket(AF_PACKET, SOCK_RAW, 0)); }},
    Action{"ask the kernel by netlink", "socket",
           [](const Target&) { return is_refused(socket(AF_NETLINK, SOCK_RAW, 0)); }},
    Action{"connect to programs of this machine", "socket",
           [](const Target&) { return is_refused(socket(AF_UNIX, SOCK_STREAM, 0)); }},
    Action{"make a pair of sockets", "socketpair",
           [](const Target&) {
             int ends[2];
             return is_refused(socketpair(AF_UNIX, SOCK_STREAM, 0, ends));
           }},
    Action{"share memory by a key", "shmget",
           [](const Target&) { return is_refused(shmget(IPC_PRIVATE, 4096, IPC_CREAT | 0600)); }},
    Action{"share memory by a name", "",
           [](const Target&) {
             const int file = shm_open("/sandbox_hostile_test", O_RDWR | O_CREAT, 0600);
             const bool is_refused_here = is_refused(file);
             shm_unlink("/sandbox_hostile_test");
             return is_refused_here;
           }},
    // Programs and processes
    Action{"execute a program", "execve",
           [](const Target&) {
             char* const arguments[] = {nullptr};
             return is_refused(execve("/bin/does-not-matter", arguments, arguments));
           }},
    Action{"execute an open file", "execveat",
           [](const Target&) {
             return is_refused(syscall(SYS_execveat, 0, "", nullptr, nullptr, 0x1000));
           }},
    Action{"fork", "clone of a process", [](const Target&) { return is_no_process(fork()); }},
    Action{"fork without handlers", "clone of a process",
           [](const Target&) { return is_no_process(_Fork()); }},
    Action{"clone a process by hand", "clone of a process",
           [](const Target&) { return is_no_process(syscall(SYS_clone, SIGCHLD, 0, 0, 0, 0)); }},
    Action{"clone a process in memory", "",
           [](const Target&) {
             std::uint64_t arguments[8] = {0, 0, 0, 0, SIGCHLD, 0, 0, 0};
             return is_no_process(syscall(435, arguments, sizeof(arguments)));
           }},
    Action{"spawn a program", kIsSanitized ? "" : "execve by posix_spawn, system or popen",
           [](const Target&) {
             char* const arguments[] = {nullptr};
             pid_t process = 0;
             return posix_spawn(&process, "/bin/true", nullptr, nullptr, arguments, arguments) ==
                    EPERM;
           }},
    Action{"run a shell", kIsSanitized ? "" : "execve by posix_spawn, system or popen",
           [](const Target&) { return system("true") == -1; }},
    Action{"read from a shell", kIsSanitized ? "" : "execve by posix_spawn, system or popen",
           [](const Target&) { return popen("true", "r") == nullptr; }},
    Action{"go into a namespace with a thread", "clone into namespaces of its own",
           [](const Target&) {
             return is_no_process(syscall(SYS_clone, SIGCHLD | CLONE_NEWUSER, 0, 0, 0, 0));
           }},
    Action{"go into a namespace", "unshare",
           [](const Target&) { return is_refused(unshare(CLONE_NEWUSER)); }},
    Action{"go into a namespace of another", "setns",
           [](const Target&) { return is_refused(setns(0, 0)); }},
    Action{"let itself be traced", "ptrace",
           [](const Target&) { return is_refused(ptrace(PTRACE_TRACEME, 0, nullptr, nullptr)); }},
    Action{"trace the supervisor", "ptrace",
           [](const Target& target) {
             return is_refused(ptrace(PTRACE_SEIZE, target.parent, nullptr, nullptr));
           }},
    Action{"read memory of the supervisor", "process_vm_readv",
           [](const Target& target) {
             char byte = 0;
             iovec own{&byte, 1};
             iovec theirs{&byte, 1};
             return is_refused(process_vm_readv(target.parent, &own, 1, &theirs, 1, 0));
           }},
    Action{"write memory of the supervisor", "process_vm_writev",
           [](const Target& target) {
             char byte = 0;
             iovec own{&byte, 1};
             iovec theirs{&byte, 1};
             return is_refused(process_vm_writev(target.parent, &own, 1, &theirs, 1, 0));
           }},
    Action{"open memory of the supervisor", "",
           [](const Target& target) {
             return is_refused(
                 open_for("/proc/" + std::to_string(target.parent) + "/mem", O_RDONLY));
           }},
    Action{"signal the supervisor", "kill to another process",
           [](const Target& target) { return is_refused(kill(target.parent, 0)); }},
    Action{"signal all processes of the user", "kill to another process",
           [](const Target&) { return is_refused(kill(-1, 0)); }},
    Action{"signal a thread of the supervisor", "tgkill to another process",
           [](const Target& target) {
             return is_refused(syscall(SYS_tgkill, target.parent, target.parent, 0));
           }},
    Action{"signal by the number of a thread", "tkill",
           [](const Target& target) { return is_refused(syscall(SYS_tkill, target.parent, 0)); }},
    Action{"get a handle of the supervisor", "pidfd_open",
           [](const Target& target) { return is_refused(syscall(434, target.parent, 0)); }},
    Action{"take a file of the supervisor", "pidfd_getfd",
           [](const Target&) { return is_refused(syscall(438, 0, 0, 0)); }},
    Action{"move the supervisor to another CPU", "",
           [](const Target& target) {
             cpu_set_t set;
             CPU_ZERO(&set);
             CPU_SET(0, &set);
             return is_refused(sched_setaffinity(target.parent, sizeof(set), &set));
           }},
    Action{"slow the supervisor down", "setpriority of another thread",
           [](const Target& target) {
             return is_refused(setpriority(PRIO_PROCESS, static_cast<id_t>(target.parent), 0));
           }},
    // Machine code
    Action{"make memory that is written and executed", "mmap of executable memory",
           [](const Target&) {
             return is_refused(mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC,
                                    MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
           }},
    Action{"make memory executable", "mprotect of executable memory",
           [](const Target&) {
             void* const page =
                 mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
             const bool is_refused_here =
                 page != MAP_FAILED && is_refused(mprotect(page, 4096, PROT_READ | PROT_EXEC));
             munmap(page, 4096);
             return is_refused_here;
           }},
    Action{"make an executable file in memory", "memfd_create of an executable file",
           [](const Target&) { return is_refused(syscall(SYS_memfd_create, "x", 0x10)); }},
    Action{"let all readable memory be executed", "personality",
           [](const Target&) { return is_refused(syscall(SYS_personality, 0x0400000)); }},
    Action{"write code through /proc/self/mem", "",
           [](const Target&) { return is_refused(open_for("/proc/self/mem", O_RDWR)); }},
    // What it was given
    Action{"become dumpable", "prctl with a request that is not known to be harmless",
           [](const Target&) { return is_refused(prctl(PR_SET_DUMPABLE, 1)); }},
    Action{"outlive the supervisor", "prctl with a request that is not known to be harmless",
           [](const Target&) { return is_refused(prctl(PR_SET_PDEATHSIG, 0)); }},
    Action{"take its limits away", "prlimit64 of other limits, or of another process",
           [](const Target&) {
             const rlimit none{RLIM_INFINITY, RLIM_INFINITY};
             return is_refused(setrlimit(RLIMIT_CORE, &none));
           }},
    Action{"hide what is refused", "rt_sigaction of SIGSYS, by which refused calls are reported",
           [](const Target&) { return signal(SIGSYS, SIG_IGN) == SIG_ERR && errno == EPERM; }},
    Action{"become another user", "setuid",
           [](const Target&) { return is_refused(syscall(SYS_setuid, 0)); }},
    Action{"get out of its process group", "setsid",
           [](const Target&) { return is_refused(setsid()); }},
    // The kernel
    Action{"mount a file system", "mount",
           [](const Target& target) {
             return is_refused(mount("none", target.folder.c_str(), "tmpfs", 0, nullptr));
           }},
    Action{"change the root", "chroot",
           [](const Target& target) { return is_refused(chroot(target.folder.c_str())); }},
    Action{"keep keys in the kernel", "add_key",
           [](const Target&) {
             return is_refused(syscall(SYS_add_key, "user", "sandbox_test", "x", 1, -1));
           }},
    Action{"read keys of the kernel", "keyctl",
           [](const Target&) { return is_refused(syscall(SYS_keyctl, 0, -3, 0, 0, 0)); }},
    Action{"load a program into the kernel", "bpf",
           [](const Target&) { return is_refused(syscall(SYS_bpf, 0, nullptr, 0)); }},
    Action{"look at others by performance counters", "perf_event_open",
           [](const Target&) {
             return is_refused(syscall(SYS_perf_event_open, nullptr, 0, -1, -1, 0));
           }},
    Action{"handle page faults", "userfaultfd",
           [](const Target&) { return is_refused(syscall(SYS_userfaultfd, 0)); }},
    Action{"use a ring of system calls", "io_uring_setup",
           [](const Target&) { return is_refused(syscall(425, 1, nullptr)); }},
    Action{"load a module", "finit_module",
           [](const Target&) { return is_refused(syscall(SYS_finit_module, -1, "", 0)); }},
    Action{"load another kernel", "kexec_load",
           [](const Target&) { return is_refused(syscall(SYS_kexec_load, 0, 0, nullptr, 0)); }},
    Action{"restart the machine", "reboot",
           [](const Target&) { return is_refused(syscall(SYS_reboot, 0, 0, 0, nullptr)); }},
    Action{"swap to a file", "swapon",
           [](const Target&) { return is_refused(syscall(SYS_swapon, nullptr, 0)); }},
    Action{"set the clock", "clock_settime",
           [](const Target&) {
             return is_refused(syscall(SYS_clock_settime, CLOCK_MONOTONIC, nullptr));
           }},
    Action{
        "open files past their names", "open_by_handle_at",
        [](const Target&) { return is_refused(syscall(SYS_open_by_handle_at, -1, nullptr, 0)); }},
    Action{"watch files", "inotify_init1",
           [](const Target&) { return is_refused(inotify_init1(0)); }},
    Action{"type into the terminal", "ioctl with a request that is not known to be harmless",
           [](const Target&) {
             char letter = 'x';
             return is_refused(ioctl(0, TIOCSTI, &letter));
           }},
    Action{"send signals by a file", "fcntl with a request that is not known to be harmless",
           [](const Target& target) { return is_refused(fcntl(0, F_SETOWN, target.parent)); }},
    Action{"do what no name is known for", "",
           [](const Target&) { return is_refused(syscall(1000)); }},
#if defined(__x86_64__)
    Action{"call by the numbers of x32", "a call of another architecture",
           [](const Target&) { return is_refused(syscall(0x40000000 | SYS_getpid)); }},
    Action{"reach ports of the hardware", "iopl",
           [](const Target&) { return is_refused(syscall(SYS_iopl, 3)); }},
    Action{"fork with the memory shared", "vfork",
           [](const Target&) { return is_no_process(syscall(SYS_vfork)); }},
#endif
    // Files
    Action{"read a file that nobody named", "",
           [](const Target&) { return is_refused(open_for("/etc/passwd", O_RDONLY)); }},
    Action{"list the root", "",
           [](const Target&) { return is_refused(open_for("/", O_RDONLY | O_DIRECTORY)); }},
    Action{"write where nobody named", "",
           [](const Target& target) {
             return is_refused(open_for(target.outside / "made", O_WRONLY | O_CREAT));
           }},
    Action{
        "delete where nobody named", "",
        [](const Target& target) { return is_refused(unlink((target.outside / "file").c_str())); }},
    Action{"write a file that may be read", "",
           [](const Target& target) { return is_refused(open_for(target.readable, O_WRONLY)); }},
    Action{"empty a file that may be read", "openat of a file that is opened for reading",
           [](const Target& target) {
             return is_refused(open_for(target.readable, O_RDONLY | O_TRUNC));
           }},
    Action{"cut a file by its name", "truncate",
           [](const Target& target) { return is_refused(truncate(target.readable.c_str(), 0)); }},
    Action{"let others read a file", "fchmodat",
           [](const Target& target) {
             return is_refused(syscall(SYS_fchmodat, AT_FDCWD, target.readable.c_str(), 0777));
           }},
    Action{"make a link out of its folder", "symlinkat",
           [](const Target& target) {
             return is_refused(symlinkat("/etc", AT_FDCWD, (target.folder / "link").c_str()));
           }},
    Action{"carry a file out of its folder", "",
           [](const Target& target) {
             close(static_cast<int>(open_for(target.folder / "inside", O_WRONLY | O_CREAT)));
             return is_refused(
                 rename((target.folder / "inside").c_str(), (target.outside / "out").c_str()));
           }},
    Action{"make a device", "mknodat",
           [](const Target& target) {
             return is_refused(mknodat(AT_FDCWD, (target.folder / "d").c_str(), S_IFIFO | 0600, 0));
           }},
};

/// What is refused of all actions: a line each, `index reported-refusals`.
std::string try_all(const Target& target) {
  std::string refused;
  for (std::size_t i = 0; i < kActions.size(); ++i) {
    static_cast<void>(take_refusals());
    errno = 0;
    if (kActions[i].is_refused(target)) {
      refused += std::to_string(i);
      for (const RefusedCall& call : take_refusals()) {
        refused += "|" + call.call;
      }
      refused += "\n";
    }
  }
  return refused;
}

class HostileComponent : public testing::Test {
 protected:
  HostileComponent() {
    target_.folder = folder_.path / "writable";
    target_.outside = folder_.path / "outside";
    target_.readable = folder_.path / "readable";
    target_.parent = getpid();
    std::filesystem::create_directory(target_.folder);
    std::filesystem::create_directory(target_.outside);
    std::ofstream(target_.readable) << "content\n";
    std::ofstream(target_.outside / "file") << "content\n";
  }

  const Target& target() const { return target_; }
  SandboxOptions options() const { return {.read = {target_.readable}, .write = {target_.folder}}; }

 private:
  Folder folder_;
  Target target_;
};

TEST_F(HostileComponent, IsRefusedEachActionByName) {
  if (kIsSanitized) {
    GTEST_SKIP() << "a sanitizer has threads and calls of its own";
  }
  const Ended ended = in_child([&] {
    if (const auto refusal = apply_sandbox(options())) {
      return refusal->what;
    }
    return try_all(target());
  });

  ASSERT_EQ(ended.status, 0) << ended.said;
  std::vector<std::string> reported(kActions.size(), "not refused");
  std::istringstream lines(ended.said);
  for (std::string line; std::getline(lines, line);) {
    const auto bar = line.find('|');
    reported.at(std::stoul(line)) = bar == std::string::npos ? "" : line.substr(bar + 1);
  }
  for (std::size_t i = 0; i < kActions.size(); ++i) {
    EXPECT_EQ(reported[i], kActions[i].reported) << kActions[i].name;
  }
  static_assert(kActions.size() >= 22);
}

/// Not to be done where nothing refuses it.
bool is_harmful(std::string_view name) {
  constexpr std::array<std::string_view, 9> kHarmful{"mount a file system",
                                                     "change the root",
                                                     "type into the terminal",
                                                     "fork with the memory shared",
                                                     "delete where nobody named",
                                                     "empty a file that may be read",
                                                     "cut a file by its name",
                                                     "carry a file out of its folder",
                                                     "move the supervisor to another CPU"};
  return std::ranges::find(kHarmful, name) != kHarmful.end();
}

TEST_F(HostileComponent, MayDoMostOfItWithoutASandbox) {
  std::size_t allowed = 0;
  for (const Action& action : kActions) {
    if (!is_harmful(action.name)) {
      const Ended ended = in_child([&] { return std::to_string(action.is_refused(target())); });
      allowed += ended.status == 0 && ended.said == "0" ? 1 : 0;
    }
  }

  EXPECT_GE(allowed, 22u);
}

TEST_F(HostileComponent, LeavesFilesAsTheyWere) {
  if (kIsSanitized) {
    GTEST_SKIP() << "a sanitizer has threads and calls of its own";
  }
  ASSERT_EQ(in_child([&] {
              const auto refusal = apply_sandbox(options());
              return refusal ? refusal->what : try_all(target());
            }).status,
            0);

  EXPECT_EQ(std::filesystem::file_size(target().readable), 8u);
  EXPECT_TRUE(std::filesystem::exists(target().outside / "file"));
  EXPECT_FALSE(std::filesystem::exists(target().outside / "made"));
  EXPECT_FALSE(std::filesystem::exists(target().outside / "out"));
}

#if defined(__x86_64__)
/// getpid, as a program of 32 bits calls it.
long call_of_32_bits() {
  long result = 20;
  asm volatile("int $0x80" : "+a"(result) : : "memory", "r8", "r9", "r10", "r11");
  return result;
}

TEST_F(HostileComponent, IsRefusedCallsOfAnotherArchitecture) {
  const Ended control = in_child([] { return std::to_string(call_of_32_bits() > 0); });
  if (kIsSanitized || control.status != 0 || control.said != "1") {
    GTEST_SKIP() << "this kernel has no calls of 32 bits";
  }

  const Ended ended = in_child([&] {
    if (const auto refusal = apply_sandbox(options())) {
      return refusal->what;
    }
    const long result = call_of_32_bits();
    const auto refused = take_refusals();
    return std::to_string(result) + " " + (refused.empty() ? "" : refused.front().call);
  });

  EXPECT_EQ(ended.status, 0);
  EXPECT_EQ(ended.said, std::to_string(-EPERM) + " a call of another architecture");
}
#endif

}  // namespace
}  // namespace fastcycle::sandbox

#include "sandbox/sandbox.h"

#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <ctime>
#include <fstream>
#include <future>
#include <memory>
#include <mutex>
#include <numeric>
#include <stdexcept>
#include <thread>

#include <dlfcn.h>
#include <fcntl.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>
#include <linux/filter.h>
#include <linux/futex.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "base/signal_stack.h"
#include "sandbox/refusals.h"
#include "sandbox/test_child.h"

namespace fastcycle::sandbox {
namespace {

using namespace std::chrono_literals;

class Sandbox : public testing::Test {
 protected:
  void SetUp() override {
    if (kIsSanitized) {
      GTEST_SKIP() << "a sanitizer has threads and calls of its own";
    }
    std::ofstream(folder_.path / "readable") << "content\n";
    std::filesystem::create_directory(folder_.path / "writable");
  }

  std::filesystem::path readable() const { return folder_.path / "readable"; }
  std::filesystem::path writable() const { return folder_.path / "writable"; }
  SandboxOptions options() const { return {.read = {readable()}, .write = {writable()}}; }

  /// Runs `action` in a sandbox. An empty text and a good end is what it says where all went well.
  Ended sandboxed(const std::function<std::string()>& action) const {
    return sandboxed(options(), action);
  }
  static Ended sandboxed(const SandboxOptions& options,
                         const std::function<std::string()>& action) {
    return in_child([&]() -> std::string {
      if (const auto refusal = apply_sandbox(options)) {
        return refusal->what;
      }
      return action();
    });
  }
  /// The same, where nothing may be refused.
  void expect_works(const std::function<std::string()>& action) const {
    const Ended ended = sandboxed([&] {
      std::string said = action();
      for (const RefusedCall& call : take_refusals()) {
        said += "; refused: " + call.call;
      }
      return said;
    });
    EXPECT_EQ(ended.said, "");
    EXPECT_EQ(ended.status, 0);
  }

 private:
  Folder folder_;
};

std::string unless(bool is_right, const std::string& what) {
  return is_right ? "" : what + " (" + std::strerror(errno) + "). ";
}

/// What a library does that places its threads.
std::string place_itself() {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  CPU_SET(0, &cpus);
  const int placed = pthread_setaffinity_np(pthread_self(), sizeof(cpus), &cpus);
  const sched_param none{};
  const int scheduled = pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
  return unless(placed == 0, "pthread_setaffinity_np") +
         unless(scheduled == 0, "pthread_setschedparam");
}

/// Forbids one system call to the calling process, as a kernel does that does not have it.
void take_away(int call) {
  sock_filter code[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<unsigned>(call), 0, 1),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const sock_fprog program{std::size(code), code};
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
      prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0) {
    _exit(3);
  }
}

// ---- What still works ----

TEST_F(Sandbox, ThreadsHandOverByMutexAndConditionVariable) {
  expect_works([] {
    std::mutex mutex;
    std::condition_variable changed;
    int turn = 0;
    const auto play = [&](int own) {
      for (int i = 0; i < 100; ++i) {
        std::unique_lock lock(mutex);
        changed.wait(lock, [&] { return turn % 2 == own; });
        ++turn;
        changed.notify_all();
      }
    };
    std::thread first(play, 0);
    std::thread second(play, 1);
    first.join();
    second.join();
    return unless(turn == 200, "turns: " + std::to_string(turn));
  });
}

TEST_F(Sandbox, ManyThreadsAllocateSmallAndLargeMemory) {
  expect_works([] {
    std::atomic<std::size_t> sum{0};
    std::vector<std::thread> threads;
    for (int i = 0; i < 8; ++i) {
      threads.emplace_back([&sum] {
        for (std::size_t size = 1; size < (std::size_t{8} << 20); size *= 2) {
          std::vector<char> memory(size, 'x');
          memory.resize(size * 2);
          sum += memory.size();
        }
      });
    }
    for (std::thread& thread : threads) {
      thread.join();
    }
    return unless(sum == 8 * 2 * ((std::size_t{8} << 20) - 1), "sum");
  });
}

TEST_F(Sandbox, AThreadSetsItsNamePlaceAndStack) {
  expect_works([] {
    std::vector<base::Refusal> refusals;
    std::string said;
    base::Thread thread(
        {.name = "worker", .cpus = {0}},
        [&said] {
          char name[16] = {};
          pthread_getname_np(pthread_self(), name, sizeof(name));
          said = unless(std::strcmp(name, "worker") == 0, "name") +
                 unless(prctl(PR_SET_TIMERSLACK, 1UL) == 0, "timer slack") +
                 unless(setpriority(PRIO_PROCESS, 0, 1) == 0, "priority") + place_itself();
        },
        refusals);
    thread.join();
    return said + unless(refusals.empty(), refusals.empty() ? "" : refusals.front().what);
  });
}

TEST_F(Sandbox, ExceptionsPassFromThreadToThread) {
  expect_works([] {
    auto answer =
        std::async(std::launch::async, []() -> int { throw std::runtime_error("thrown"); });
    try {
      answer.get();
    } catch (const std::runtime_error& error) {
      return unless(std::string(error.what()) == "thrown", "text");
    }
    return std::string("no exception");
  });
}

TEST_F(Sandbox, ClocksRunAndSleepersWake) {
  expect_works([] {
    const auto begin = std::chrono::steady_clock::now();
    std::this_thread::sleep_for(2ms);
    timespec until{};
    clock_gettime(CLOCK_MONOTONIC, &until);
    until.tv_nsec += until.tv_nsec < 990'000'000 ? 2'000'000 : 0;
    const int slept = clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
    const std::time_t now = std::time(nullptr);
    std::tm local{};
    return unless(std::chrono::steady_clock::now() - begin >= 2ms, "too early") +
           unless(slept == 0, "clock_nanosleep") +
           unless(localtime_r(&now, &local) != nullptr, "localtime");
  });
}

TEST_F(Sandbox, ASleeperOfSeveralFutexesIsWoken) {
  expect_works([]() -> std::string {
    struct Waiter {  // futex_waitv, which old headers do not have
      std::uint64_t value;
      std::uint64_t address;
      std::uint32_t flags;
      std::uint32_t reserved;
    };
    constexpr std::uint32_t k32Bits = 2;
    std::array<std::atomic<std::uint32_t>, 3> words{};
    std::array<Waiter, 3> waiters{};
    for (std::size_t i = 0; i < words.size(); ++i) {
      waiters[i] = {0, reinterpret_cast<std::uint64_t>(&words[i]), k32Bits, 0};
    }
    std::thread waker([&words] {
      std::this_thread::sleep_for(5ms);
      words[2].store(1);
      syscall(SYS_futex, &words[2], FUTEX_WAKE, 1, nullptr, nullptr, 0);
    });
    while (words[2].load() == 0) {
      if (syscall(449, waiters.data(), waiters.size(), 0, nullptr, 0) < 0 && errno == EPERM) {
        waker.join();
        return "futex_waitv";
      }
    }
    waker.join();
    return "";
  });
}

TEST_F(Sandbox, DescriptorsAreMadeAndWaitedFor) {
  expect_works([] {
    const int event = eventfd(0, EFD_CLOEXEC);
    const int timer = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC);
    const itimerspec soon{.it_interval = {}, .it_value = {.tv_sec = 0, .tv_nsec = 1'000'000}};
    timerfd_settime(timer, 0, &soon, nullptr);
    pollfd files[] = {{event, POLLIN, 0}, {timer, POLLIN, 0}};
    const bool is_due = poll(files, 2, 10'000) == 1 && files[1].revents == POLLIN;
    const std::uint64_t one = 1;
    const bool is_written = write(event, &one, sizeof(one)) == sizeof(one);
    int ends[2];
    return unless(event >= 0, "eventfd") + unless(timer >= 0, "timerfd") + unless(is_due, "poll") +
           unless(is_written, "write") + unless(pipe(ends) == 0, "pipe");
  });
}

TEST_F(Sandbox, ANamedFileIsRead) {
  expect_works([this] {
    std::string line;
    std::getline(std::ifstream(readable()), line);
    return unless(line == "content", "read: " + line);
  });
}

TEST_F(Sandbox, AFileIsMadeWrittenRenamedAndDeletedInANamedFolder) {
  expect_works([this] {
    std::filesystem::create_directory(writable() / "deeper");
    std::ofstream(writable() / "made") << "written";
    std::ofstream(writable() / "made") << "again";
    std::filesystem::rename(writable() / "made", writable() / "deeper" / "renamed");
    std::string line;
    std::getline(std::ifstream(writable() / "deeper" / "renamed"), line);
    return unless(line == "again", "read: " + line) +
           unless(std::filesystem::remove_all(writable() / "deeper") == 2, "remove");
  });
}

TEST_F(Sandbox, WhatIsWrittenNowhereIsWritten) {
  expect_works([] { return unless(static_cast<bool>(std::ofstream("/dev/null") << "x"), "null"); });
}

TEST_F(Sandbox, MessagesAreSerializedParsedAndPrinted) {
  expect_works([] {
    google::protobuf::Struct message;
    (*message.mutable_fields())["speed_mps"].set_number_value(13.9);
    google::protobuf::Struct parsed;
    std::string json;
    std::string said = unless(parsed.ParseFromString(message.SerializeAsString()), "parse");
    said += unless(google::protobuf::util::MessageToJsonString(parsed, &json).ok(), "print");
    said += unless(json == R"({"speed_mps":13.9})", json);
    return said;
  });
}

TEST_F(Sandbox, AProcessSignalsItselfAndHandlesIt) {
  expect_works([] {
    static std::atomic<int> caught{0};
    struct sigaction action{};
    action.sa_handler = [](int) { ++caught; };
    sigaction(SIGUSR1, &action, nullptr);
    raise(SIGUSR1);
    kill(getpid(), SIGUSR1);
    return unless(caught == 2, "signals: " + std::to_string(caught));
  });
}

TEST_F(Sandbox, ACrashEndsTheProcessByItsOwnSignal) {
  const Ended ended = in_child([this]() -> std::string {
    const rlimit none{};
    setrlimit(RLIMIT_CORE, &none);
    if (const auto refusal = apply_sandbox(options())) {
      return refusal->what;
    }
    std::abort();
  });

  EXPECT_TRUE(WIFSIGNALED(ended.status) && WTERMSIG(ended.status) == SIGABRT) << ended.status;
}

TEST_F(Sandbox, TheHardwareIsCounted) {
  expect_works([] {
    return unless(std::thread::hardware_concurrency() >= 1, "threads") +
           unless(sysconf(_SC_NPROCESSORS_ONLN) >= 1, "cpus") +
           unless(sysconf(_SC_PHYS_PAGES) >= 1, "memory");
  });
}

// ---- Refusals ----

TEST_F(Sandbox, ARefusalIsCountedForWhoCalled) {
  static thread_local std::uint32_t working_for = 0;
  SandboxOptions with_who = options();
  with_who.who = [] { return working_for; };
  const Ended ended = sandboxed(with_who, [] {
    const auto call_for = [](std::uint32_t component, int times) {
      working_for = component;
      for (int i = 0; i < times; ++i) {
        static_cast<void>(socket(AF_INET, SOCK_STREAM, 0));
      }
    };
    std::thread(call_for, 7, 3).join();
    std::thread(call_for, 8, 2).join();
    std::string said;
    for (const RefusedCall& call : take_refusals()) {
      said += call.call + " of " + std::to_string(call.component) + ": " +
              std::to_string(call.count) + (call.thread != getpid() ? "\n" : " here\n");
    }
    return said + (take_refusals().empty() ? "none left" : "some left");
  });

  EXPECT_THAT(ended.said, testing::HasSubstr("socket of 7: 3\n"));
  EXPECT_THAT(ended.said, testing::HasSubstr("socket of 8: 2\n"));
  EXPECT_THAT(ended.said, testing::HasSubstr("none left"));
}

TEST_F(Sandbox, ARefusalLeavesOtherRegistersAndErrnoOfOtherCallsAlone) {
  expect_works([] {
    errno = 0;
    const bool is_refused = socket(AF_INET, SOCK_STREAM, 0) == -1 && errno == EPERM;
    static_cast<void>(take_refusals());
    return unless(is_refused, "socket") + unless(getppid() > 0, "getppid");
  });
}

/// The C library calls its own `fork`, which holds SIGSYS back, not ours.
TEST_F(Sandbox, AProcessOfTheCLibraryItselfIsRefusedAndGoesOn) {
  const Ended ended = sandboxed([] {
    const int result = daemon(1, 1);
    const int error = errno;
    return unless(result == -1 && error == EPERM, "daemon");
  });

  EXPECT_EQ(ended.said, "");
  EXPECT_EQ(ended.status, 0);
}

TEST_F(Sandbox, AThreadThatHoldsAllSignalsBackIsRefusedAndGoesOn) {
  const Ended ended = sandboxed([] {
    int result = 0;
    int error = 0;
    sigset_t all;
    sigfillset(&all);
    std::thread([&] {
      pthread_sigmask(SIG_SETMASK, &all, nullptr);
      result = socket(AF_INET, SOCK_STREAM, 0);
      error = errno;
    }).join();
    sigprocmask(SIG_BLOCK, &all, nullptr);
    result += socket(AF_INET, SOCK_STREAM, 0);
    sigset_t held;
    sigprocmask(SIG_BLOCK, nullptr, &held);
    return unless(result == -2 && error == EPERM, "socket") +
           unless(sigismember(&held, SIGUSR1) == 1, "SIGUSR1 is not held back") +
           unless(take_refusals().size() == 1, "reported");
  });

  EXPECT_EQ(ended.said, "");
  EXPECT_EQ(ended.status, 0);
}

TEST_F(Sandbox, AThreadWithAStackForSignalsIsRefusedAndGoesOn) {
  const Ended ended = sandboxed([] {
    std::string said;
    std::thread([&] {
      const base::SignalStack stack;
      said = unless(socket(AF_INET, SOCK_STREAM, 0) == -1 && errno == EPERM, "socket");
    }).join();
    return said;
  });

  EXPECT_EQ(ended.said, "");
  EXPECT_EQ(ended.status, 0);
}

TEST_F(Sandbox, ARefusedCallInAnotherSignalHandlerIsRefused) {
  const Ended ended = sandboxed([] {
    static std::atomic<int> error{0};
    struct sigaction action{};
    action.sa_handler = [](int) {
      static_cast<void>(socket(AF_INET, SOCK_STREAM, 0));
      error = errno;
    };
    sigfillset(&action.sa_mask);
    sigdelset(&action.sa_mask, SIGSYS);
    sigaction(SIGUSR1, &action, nullptr);
    raise(SIGUSR1);
    return unless(error == EPERM, "socket");
  });

  EXPECT_EQ(ended.said, "");
  EXPECT_EQ(ended.status, 0);
}

TEST_F(Sandbox, AFloodOfRefusalsOfManyKindsIsBounded) {
  static thread_local std::uint32_t working_for = 0;
  SandboxOptions with_who = options();
  with_who.who = [] { return working_for; };
  const Ended ended = sandboxed(with_who, [] {
    for (working_for = 1; working_for <= 300; ++working_for) {
      static_cast<void>(socket(AF_INET, SOCK_STREAM, 0));
    }
    std::uint64_t sum = 0;
    std::uint64_t others = 0;
    const auto refused = take_refusals();
    for (const RefusedCall& call : refused) {
      sum += call.count;
      others += call.call == "other calls" ? call.count : 0;
    }
    return std::to_string(refused.size()) + " " + std::to_string(sum) + " " +
           std::to_string(others);
  });

  EXPECT_EQ(ended.said, "257 300 44");
}

TEST_F(Sandbox, ASignalFromOutsideIsNoRefusal) {
  expect_works([] {
    raise(SIGSYS);
    return std::string();
  });
}

// ---- Code that is loaded later ----

constexpr const char* kSomeLibrary = "libresolv.so.2";  // Of the C library, and loaded by nobody.

TEST_F(Sandbox, ALibraryIsNotLoadedLater) {
  const Ended ended = sandboxed([] {
    const bool is_loaded = dlopen(kSomeLibrary, RTLD_NOW) != nullptr;
    return std::string(is_loaded ? "loaded" : "refused");
  });

  EXPECT_EQ(ended.said, "refused");
}

TEST_F(Sandbox, ALibraryIsLoadedLaterWhereThatIsAllowed) {
  SandboxOptions loading = options();
  loading.may_load_code = true;
  const Ended ended = sandboxed(loading, [] {
    const bool is_loaded = dlopen(kSomeLibrary, RTLD_NOW) != nullptr;
    void* const both =
        mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return unless(is_loaded, "not loaded") + unless(both == MAP_FAILED, "written and executed");
  });

  EXPECT_EQ(ended.said, "");
}

// ---- What is reported instead of a sandbox that is not there ----

TEST_F(Sandbox, AKernelWithoutLandlockIsReported) {
  const Ended ended = in_child([this] {
    take_away(444);
    const auto refusal = apply_sandbox(options());
    return refusal ? refusal->what + " | " + refusal->remedy : "applied";
  });

  EXPECT_THAT(ended.said, testing::HasSubstr("there is no Landlock here"));
  EXPECT_THAT(ended.said, testing::HasSubstr("CONFIG_SECURITY_LANDLOCK"));
}

TEST_F(Sandbox, AKernelWithoutFiltersIsReported) {
  const Ended ended = in_child([this] {
    take_away(SYS_seccomp);
    const auto refusal = apply_sandbox(options());
    return refusal ? refusal->what + " | " + refusal->remedy : "applied";
  });

  EXPECT_THAT(ended.said, testing::HasSubstr("system calls cannot be filtered here"));
  EXPECT_THAT(ended.said, testing::HasSubstr("CONFIG_SECCOMP_FILTER"));
}

TEST_F(Sandbox, APathThatIsNotThereIsReported) {
  const Ended ended = in_child([this] {
    const auto refusal = apply_sandbox({.read = {writable() / "nothing"}});
    return refusal ? refusal->what : "applied";
  });

  EXPECT_THAT(ended.said, testing::HasSubstr("writable/nothing: No such file or directory"));
}

TEST_F(Sandbox, ThreadsThatAreThereAlreadyAreReportedByName) {
  const Ended ended = in_child([this] {
    std::promise<void> begun;
    std::promise<void> over;
    std::thread early([&] {
      pthread_setname_np(pthread_self(), "early bird");
      begun.set_value();
      over.get_future().wait();
    });
    begun.get_future().wait();
    const auto refusal = apply_sandbox(options());
    over.set_value();
    early.join();
    return refusal ? refusal->what : "applied";
  });

  EXPECT_THAT(ended.said, testing::HasSubstr("which it would not restrict: early bird"));
}

TEST_F(Sandbox, CapabilitiesOfRootAreGivenUp) {
  const Ended ended = sandboxed([] {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with("CapEff:")) {
        const unsigned long kept = std::stoul(line.substr(7), nullptr, 16);
        constexpr unsigned long kRealTime = 1UL << 23 | 1UL << 14;  // CAP_SYS_NICE, CAP_IPC_LOCK
        return unless((kept & ~kRealTime) == 0, line);
      }
    }
    return std::string("nothing is said");
  });

  EXPECT_EQ(ended.said, "");
}

}  // namespace
}  // namespace fastcycle::sandbox

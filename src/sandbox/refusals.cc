#include "sandbox/refusals.h"

#include <array>
#include <atomic>
#include <cerrno>

#include <signal.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include "sandbox/call_names.h"

namespace fastcycle::sandbox {
namespace {

constexpr std::size_t kKinds = 256;  ///< A power of two.
constexpr std::uint64_t kUsed = std::uint64_t{1} << 63;

/// Refused calls of one kind. A used slot keeps its kind.
struct Counter {
  std::atomic<std::uint64_t> kind{0};  ///< `kUsed`, rule, call and component; 0: free.
  std::atomic<std::uint64_t> count{0};
  std::atomic<std::int32_t> thread{0};
};

// State of the signal handler, which has no arguments and must not allocate.
struct State {
  std::atomic<WhoCalls> who{nullptr};
  std::atomic<bool> is_installed{false};
  std::array<Counter, kKinds> counters;
  Counter others;
};
State g_state;

constexpr std::uint64_t kind_of(Rule rule, int call, std::uint32_t component) noexcept {
  return kUsed | static_cast<std::uint64_t>(rule) << 48 |
         (static_cast<std::uint64_t>(call) & 0xffff) << 32 | component;
}

Counter& counter_of(std::uint64_t kind) noexcept {
  const std::size_t first = (kind * 0x9e3779b97f4a7c15) >> 56;
  for (std::size_t i = 0; i < kKinds; ++i) {
    Counter& counter = g_state.counters[(first + i) % kKinds];
    std::uint64_t found = counter.kind.load(std::memory_order_relaxed);
    if (found == kind || (found == 0 && (counter.kind.compare_exchange_strong(
                                             found, kind, std::memory_order_relaxed) ||
                                         found == kind))) {
      return counter;
    }
  }
  return g_state.others;
}

void set_result(void* context, long result) noexcept {
  auto& machine = static_cast<ucontext_t*>(context)->uc_mcontext;
#if defined(__x86_64__)
  machine.gregs[REG_RAX] = result;
#elif defined(__aarch64__)
  machine.regs[0] = static_cast<std::uint64_t>(result);
#else
#error "The sandbox knows x86_64 and aarch64."
#endif
}

void on_refused_call(int /*signal*/, siginfo_t* info, void* context) {
  constexpr int kFromFilter = 1;  // SYS_SECCOMP, which old headers lack.
  if (info->si_code != kFromFilter) {
    return;  // Sent by a process.
  }
  const int error = errno;
  note_refusal(static_cast<Rule>(info->si_errno), info->si_syscall);
  set_result(context, -EPERM);
  errno = error;
}

/// Descriptions; `%` is replaced by the name of the call.
constexpr std::array<const char*, static_cast<std::size_t>(Rule::kCount)> kWords{
    "%",
    "% of a process",
    "% into namespaces of its own",
    "% of executable memory",
    "% of a file that is opened for reading",
    "% to another process",
    "% of another thread",
    "% of other limits, or of another process",
    "% of SIGSYS, by which refused calls are reported",
    "% with a request that is not known to be harmless",
    "% of an executable file",
    "a call of another architecture",
    "% by posix_spawn, system or popen",
};

std::string words_for(std::uint64_t kind) {
  const auto call = static_cast<int>((kind >> 32) & 0xffff);
  const auto rule = static_cast<std::size_t>((kind & ~kUsed) >> 48);
  const char* const name = name_of_call(call);
  std::string words = rule < kWords.size() ? kWords[rule] : "%";
  if (const auto place = words.find('%'); place != std::string::npos) {
    words.replace(place, 1, name != nullptr ? name : "system call " + std::to_string(call));
  }
  return words;
}

void take(Counter& counter, std::vector<RefusedCall>& refused) {
  const std::uint64_t kind = counter.kind.load(std::memory_order_relaxed);
  // The thread was stored before the count that is read here.
  if (const std::uint64_t count = counter.count.exchange(0, std::memory_order_acquire);
      count != 0) {
    refused.push_back({.call = kind == 0 ? "other calls" : words_for(kind),
                       .component = static_cast<std::uint32_t>(kind),
                       .thread = counter.thread.load(std::memory_order_relaxed),
                       .count = count});
  }
}

}  // namespace

bool install_refusal_handler(WhoCalls who) noexcept {
  g_state.who.store(who);
  struct sigaction action{};
  action.sa_sigaction = &on_refused_call;
  // A refused call may come from another handler, on any stack.
  action.sa_flags = SA_SIGINFO | SA_ONSTACK | SA_NODEFER | SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGSYS);
  if (sigaction(SIGSYS, &action, nullptr) != 0) {
    return false;
  }
  g_state.is_installed.store(true);
  errno = pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  return errno == 0;
}

bool is_refusal_handler_installed() noexcept {
  return g_state.is_installed.load(std::memory_order_relaxed);
}

void note_refusal(Rule rule, int call) noexcept {
  const WhoCalls who = g_state.who.load(std::memory_order_relaxed);
  Counter& counter = counter_of(kind_of(rule, call, who != nullptr ? who() : 0));
  counter.thread.store(static_cast<std::int32_t>(syscall(SYS_gettid)), std::memory_order_relaxed);
  counter.count.fetch_add(1, std::memory_order_release);
}

std::vector<RefusedCall> take_refusals() {
  std::vector<RefusedCall> refused;
  for (Counter& counter : g_state.counters) {
    take(counter, refused);
  }
  take(g_state.others, refused);
  return refused;
}

}  // namespace fastcycle::sandbox

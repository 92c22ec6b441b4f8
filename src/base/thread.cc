#include "base/thread.h"

#include <cerrno>
#include <chrono>
#include <cstring>
#include <exception>
#include <future>
#include <memory>
#include <system_error>
#include <utility>

#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>

#include "base/priority.h"
#include "base/signal_stack.h"
#include "fastcycle/assert.h"

namespace fastcycle::base {
namespace {

// Sanitizers and deep user code need more than the framework's own part; the system hands out pages
// as they are touched, so a larger reservation costs nothing, but only this much is prefaulted.
constexpr std::size_t kReservedStack = 8UL * 1024 * 1024;

struct Start {
  ThreadOptions options;
  std::function<void()> body;
  std::promise<std::vector<Refusal>> refusals;
};

std::string list_of(const std::vector<int>& cpus) {
  std::string text;
  for (const int cpu : cpus) {
    text += (text.empty() ? "" : ",") + std::to_string(cpu);
  }
  return text;
}

void pin(const ThreadOptions& options, std::vector<Refusal>& refusals) {
  if (options.cpus.empty()) {
    return;
  }
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int cpu : options.cpus) {
    CPU_SET(static_cast<std::size_t>(cpu), &set);
  }
  if (sched_setaffinity(0, sizeof(set), &set) != 0) {
    refusals.push_back(
        {"cpus " + list_of(options.cpus) + " for thread " + options.name + ": " +
             std::strerror(errno),
         "name CPUs that `nproc --all` counts and `taskset -p $$` shows as allowed"});
  }
}

void set_policy(const ThreadOptions& options, std::vector<Refusal>& refusals) {
  if (options.policy == SchedulingPolicy::kOther) {
    const std::chrono::microseconds slice(options.slice_us);
    if (slice.count() != 0 && !set_time_slice(slice)) {
      refusals.push_back({"slice_us " + std::to_string(options.slice_us) + " for thread " +
                              options.name + ": the kernel has no time slices of single threads",
                          "use Linux 6.12 or later"});
    }
    return;
  }
  if (options.policy == SchedulingPolicy::kIdle) {
    const sched_param none{};
    sched_setscheduler(0, SCHED_IDLE, &none);  // Which every thread may be.
    return;
  }
  const bool is_fifo = options.policy == SchedulingPolicy::kFifo;
  sched_param parameter{};
  parameter.sched_priority = options.priority;
  if (sched_setscheduler(0, is_fifo ? SCHED_FIFO : SCHED_RR, &parameter) != 0) {
    refusals.push_back(
        {std::string("policy ") + (is_fifo ? "fifo" : "rr") + " with priority " +
             std::to_string(options.priority) + " for thread " + options.name + ": " +
             std::strerror(errno),
         "grant it with a line `@realtime - rtprio 99` in /etc/security/limits.conf for a group of "
         "yours, or with `LimitRTPRIO=99` in the unit of a service"});
  }
}

void prefault_stack() noexcept {
  volatile char pages[kStackSize - 16 * 1024];
  for (std::size_t i = 0; i < sizeof(pages); i += 4096) {
    pages[i] = 0;
  }
}

void* run(void* argument) {
  const std::unique_ptr<Start> start(static_cast<Start*>(argument));
  pthread_setname_np(pthread_self(), start->options.name.substr(0, 15).c_str());
  prctl(PR_SET_TIMERSLACK, 1UL);
  std::vector<Refusal> refusals;
  pin(start->options, refusals);
  set_policy(start->options, refusals);
  prefault_stack();
  const SignalStack signal_stack;
  start->refusals.set_value(std::move(refusals));
  start->body();
  return nullptr;
}

}  // namespace

Thread::Thread(const ThreadOptions& options, std::function<void()> body,
               std::vector<Refusal>& refusals) {
  auto start = std::make_unique<Start>(Start{options, std::move(body), {}});
  auto answer = start->refusals.get_future();
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kReservedStack);
  const int error = pthread_create(&thread_, &attributes, &run, start.get());
  pthread_attr_destroy(&attributes);
  if (error != 0) {
    throw std::system_error(error, std::generic_category(), "thread " + options.name);
  }
  static_cast<void>(start.release());
  is_joinable_ = true;
  for (Refusal& refusal : answer.get()) {
    refusals.push_back(std::move(refusal));
  }
}

Thread::Thread(Thread&& other) noexcept
    : thread_(other.thread_), is_joinable_(std::exchange(other.is_joinable_, false)) {}

Thread& Thread::operator=(Thread&& other) noexcept {
  std::swap(thread_, other.thread_);
  std::swap(is_joinable_, other.is_joinable_);
  return *this;
}

Thread::~Thread() {
  FASTCYCLE_ASSERT(!is_joinable_, "a thread is joined before it is destroyed");
}

void Thread::join() {
  if (std::exchange(is_joinable_, false)) {
    pthread_join(thread_, nullptr);
  }
}

}  // namespace fastcycle::base

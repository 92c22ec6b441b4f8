#include "executor/activation.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <string_view>
#include <vector>

#include <sys/syscall.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/fork.h"
#include "broker/subscription.h"
#include "broker/topics.h"

namespace fastcycle::detail {

constinit thread_local RunningActivation running_activation;

namespace {

/// All serving threads of the process.
struct Registry {
  struct Entry {
    const RunningActivation* running;
    pthread_t thread;
    pid_t id;
  };
  std::mutex mutex;
  std::vector<Entry> threads;
};

Registry& registry() {
  static auto& the_registry = *new Registry;  // Threads may end after the statics are gone.
  return the_registry;
}

void write_words(std::initializer_list<std::string_view> words) noexcept {
  for (const std::string_view word : words) {
    [[maybe_unused]] const ssize_t count = write(STDERR_FILENO, word.data(), word.size());
  }
}

/// In a child: the callback under way is looked at when it returns.
void mark_activation() {
  if (const ActorBase* actor = running_activation.actor.load(std::memory_order_relaxed);
      actor != nullptr && running_activation.record != nullptr) {
    const_cast<ActorBase*>(actor)->publishing.has_leftovers = true;
  }
}

}  // namespace

CallScope::CallScope(const ActorBase& actor, const char* call, const char* detail,
                     bool has_limit) noexcept
    : actor_(running_activation.actor.load(std::memory_order_relaxed)),
      call_(running_activation.call.load(std::memory_order_relaxed)),
      detail_(running_activation.detail),
      begin_ns_(running_activation.begin_ns.load(std::memory_order_relaxed)),
      number_(running_activation.number.load(std::memory_order_relaxed)) {
  RunningActivation& running = running_activation;
  running.call.store(call, std::memory_order_relaxed);
  running.detail = detail;
  if (actor_ == nullptr) {
    running.number.store(0, std::memory_order_relaxed);
  }
  running.begin_ns.store(has_limit ? base::monotonic_ns() : 0, std::memory_order_relaxed);
  running.actor.store(&actor, std::memory_order_release);
}

CallScope::~CallScope() {
  if (base::has_forked()) {
    end_forked_child();
  }
  RunningActivation& running = running_activation;
  running.actor.store(actor_, std::memory_order_relaxed);
  running.call.store(call_, std::memory_order_relaxed);
  running.detail = detail_;
  running.number.store(number_, std::memory_order_relaxed);
  running.begin_ns.store(begin_ns_, std::memory_order_relaxed);
}

ServingThread::ServingThread() {
  pthread_attr_t attributes;
  if (pthread_getattr_np(pthread_self(), &attributes) == 0) {
    void* lowest = nullptr;
    std::size_t size = 0;
    pthread_attr_getstack(&attributes, &lowest, &size);
    running_activation.stack_end = reinterpret_cast<std::uintptr_t>(lowest);
    pthread_attr_destroy(&attributes);
  }
  base::set_after_fork(&mark_activation);
  base::watch_forks();
  const std::lock_guard lock(registry().mutex);
  registry().threads.push_back(
      {&running_activation, pthread_self(), static_cast<pid_t>(syscall(SYS_gettid))});
}

ServingThread::~ServingThread() {
  const std::lock_guard lock(registry().mutex);
  std::erase_if(registry().threads,
                [](const Registry::Entry& entry) { return entry.running == &running_activation; });
}

void for_each_serving_thread(const std::function<void(const ServingThreadView&)>& look) {
  const std::lock_guard lock(registry().mutex);
  for (const Registry::Entry& entry : registry().threads) {
    look({.running = *entry.running, .thread = entry.thread, .id = entry.id});
  }
}

void end_forked_child() noexcept {
  const ActorBase* const actor = running_activation.actor.load(std::memory_order_relaxed);
  write_words({"fastcycle: component \"", actor == nullptr ? "?" : std::string_view(actor->name),
               "\", in "});
  if (const char* const call = running_activation.call.load(std::memory_order_relaxed)) {
    write_words({call});
  } else if (running_activation.subscription != nullptr) {
    write_words({"its callback for \"", running_activation.subscription->topic.name, "\""});
  } else {
    write_words({running_activation.timer != nullptr ? "a timer" : "an activation"});
  }
  write_words(
      {", called fork(), and the call returned in the child too, where there is no "
       "framework: the child ends here, with exit code 1; end it by _exit() or exec()\n"});
  syscall(SYS_exit_group, 1);
  __builtin_unreachable();
}

}  // namespace fastcycle::detail

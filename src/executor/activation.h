#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include <pthread.h>
#include <sys/types.h>

#include "base/signal_stack.h"
#include "executor/activation_ring.h"
#include "executor/actor_base.h"

namespace fastcycle::detail {

class Subscription;
class TimerCore;

/// What a thread currently does for a component: for reports of crashes and hangs.
struct RunningActivation {
  // Also read by other threads, which read `begin_ns` again afterwards: it differs for each call.
  std::atomic<const ActorBase*> actor{nullptr};  ///< Null: none.
  std::atomic<const char*> call{nullptr};        ///< "its start()", a literal; null: a callback.
  std::atomic<std::uint64_t> number{0};          ///< Of the activation; 0: it is none.
  std::atomic<std::int64_t> begin_ns{0};         ///< CLOCK_MONOTONIC; 0: without a limit.

  // Read by the thread itself, and by its signal handlers.
  const ActivationRecord* record = nullptr;
  const Subscription* subscription = nullptr;  ///< Of the message that it handles; or null.
  const TimerCore* timer = nullptr;            ///< Of the tick that it handles; or null.
  const char* detail = nullptr;                ///< More about `call`; or none.
  std::uintptr_t stack_end = 0;                ///< The lowest address of its stack; 0: unknown.
};

extern constinit thread_local RunningActivation running_activation
    [[gnu::tls_model("initial-exec")]];

/// What the calling thread currently does for a component; null if nothing.
[[nodiscard]] inline const RunningActivation* current_activation() noexcept {
  return running_activation.actor.load(std::memory_order_relaxed) == nullptr ? nullptr
                                                                             : &running_activation;
}

/// The subscription or timer of an activation; neither for those of the framework.
struct ActivationTarget {
  const Subscription* subscription = nullptr;
  const TimerCore* timer = nullptr;
};

/// Scope of one activation, from before its callback to the end of its fault handling. Within it,
/// the component may publish on the calling thread only.
///
/// @realtime A few stores: no lock, no allocation, no system call.
class ActivationContext {
 public:
  /// `record`, which must outlive this, has number and begin.
  ActivationContext(const ActorBase& actor, PublishingComponent& publishing,
                    const ActivationRecord& record, ActivationTarget target) noexcept
      : publishing_(publishing) {
    RunningActivation& running = running_activation;
    running.record = &record;
    running.subscription = target.subscription;
    running.timer = target.timer;
    running.number.store(record.number, std::memory_order_relaxed);
    running.begin_ns.store(record.begin_ns, std::memory_order_relaxed);
    running.actor.store(&actor, std::memory_order_release);
    publishing_.enter();
    if (publishing_.reads != nullptr) {
      publishing_.reads->begin(record.number);
    }
  }
  ActivationContext(const ActivationContext&) = delete;
  ActivationContext& operator=(const ActivationContext&) = delete;
  ~ActivationContext() {
    publishing_.leave();
    RunningActivation& running = running_activation;
    running.actor.store(nullptr, std::memory_order_relaxed);  // The other fields are not read then.
    running.record = nullptr;
  }

 private:
  PublishingComponent& publishing_;
};

/// Scope of a call of a component that is no activation, or within one: its constructor, its
/// destructor, a thread of its own. In a child forked within it, its end ends the process.
class CallScope {
 public:
  /// `call` and `detail` outlive it. Without a limit its duration is not monitored.
  CallScope(const ActorBase& actor, const char* call, const char* detail = nullptr,
            bool has_limit = true) noexcept;
  CallScope(const CallScope&) = delete;
  CallScope& operator=(const CallScope&) = delete;
  ~CallScope();

 private:
  const ActorBase* const actor_;
  const char* const call_;
  const char* const detail_;
  const std::int64_t begin_ns_;
  const std::uint64_t number_;
};

/// A call within an activation, as text, which is also set in `RunningActivation`.
///
/// @threads  As the component's activations; `load` is Safe.
class NotedCall {
 public:
  NotedCall& operator=(const char* call) noexcept {
    static_cast<void>(exchange(call));
    return *this;
  }
  const char* exchange(const char* call) noexcept {
    running_activation.call.store(call, std::memory_order_relaxed);
    return call_.exchange(call);
  }
  [[nodiscard]] const char* load() const noexcept { return call_.load(); }

 private:
  std::atomic<const char*> call_{nullptr};
};

/// Registers the calling thread as one that serves components, with a stack for its signal
/// handlers.
///
/// @threads  Constructed and destroyed on that thread.
class ServingThread {
 public:
  ServingThread();
  ServingThread(const ServingThread&) = delete;
  ServingThread& operator=(const ServingThread&) = delete;
  ~ServingThread();

 private:
  const base::SignalStack signal_stack_;
};

/// A view of one of them.
struct ServingThreadView {
  const RunningActivation& running;
  pthread_t thread;
  pid_t id;  ///< As the kernel counts threads.
};

/// Calls `look` with each serving thread; none ends meanwhile. Safe.
void for_each_serving_thread(const std::function<void(const ServingThreadView&)>& look);

/// Called in a child that was forked within a callback, once that has returned: reports it, and
/// ends the process. The child may call `_exit` or `exec` before.
[[noreturn]] void end_forked_child() noexcept;

}  // namespace fastcycle::detail

#include "base/fork.h"

#include <atomic>

#include <pthread.h>

namespace fastcycle::base {
namespace {

// For the fork handler, which has no arguments.
std::atomic<bool> g_is_child{false};
std::atomic<void (*)()> g_action{nullptr};

void begin_child() {
  g_is_child.store(true);
  if (const auto action = g_action.load()) {
    action();
  }
}

}  // namespace

void watch_forks() noexcept {
  static const int registered = pthread_atfork(nullptr, nullptr, &begin_child);
  static_cast<void>(registered);
  g_is_child.store(false);  // A child that calls this is a process of its own.
}

bool has_forked() noexcept {
  return g_is_child.load(std::memory_order_relaxed);
}

void set_after_fork(void (*action)()) noexcept {
  g_action.store(action);
}

}  // namespace fastcycle::base

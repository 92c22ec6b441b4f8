#pragma once

#include <atomic>
#include <cstdint>

#include "measure/clock.h"
#include "measure/floors.h"
#include "measure/usage.h"

namespace fastcycle::measure {

/// Like FastCycle's own workers: a timer slack of one nanosecond, and the policy of `plan`.
void set_up_thread(const Plan& plan) noexcept;
/// The same for a thread that only receives: it has the time slice of `plan` as well.
void set_up_receiver(const Plan& plan) noexcept;

/// Lets the other hyperthread of the core run, in a loop that waits.
inline void pause_briefly() noexcept {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

[[nodiscard]] inline std::int64_t total(const Plan& plan) noexcept {
  return plan.warmup + plan.count;
}

[[nodiscard]] inline bool is_stopped(const Plan& plan) noexcept {
  return plan.stop != nullptr && plan.stop->load(std::memory_order_relaxed);
}

/// Calls `act(number)` once each interval, until the plan is complete or stopped; returns the usage
/// after the warm-up.
template <typename Act>
Usage each_interval(const Plan& plan, const Act& act) {
  Usage at_begin = Usage::now();
  const std::int64_t begin_ns = now_ns();
  for (std::int64_t number = 0; number < total(plan) && !is_stopped(plan); ++number) {
    const std::int64_t due_ns = begin_ns + (number + 1) * plan.interval_us * 1000;
    sleep_until(due_ns);
    if (number == plan.warmup) {
      at_begin = Usage::now();
    }
    act(number, due_ns);
  }
  return Usage::now() - at_begin;
}

}  // namespace fastcycle::measure

#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <vector>

#include "base/thread.h"
#include "diagnostics/who_runs.h"

namespace fastcycle::diagnostics {

/// Checks whether calls of components return, on a thread of its own that sleeps most of the time.
///
/// The period of checks is a quarter of the smallest limit, or of the notice, at least 5 ms and at
/// most 1 s. It reads the state that serving threads publish: it costs a callback nothing.
///
/// @threads  Confined to its owner; the functions are called on the thread of its own.
class Watchdog {
 public:
  struct Options {
    /// The limit of `call`; none: no limit.
    std::function<std::optional<std::chrono::nanoseconds>(const RunningCall& call)> limit_of;
    std::chrono::nanoseconds smallest_limit{0};  ///< 0: nothing is checked.
    /// Called once for each call that takes longer than `notice` but is within its limit. Its stack
    /// is not read.
    std::function<void(const RunningCall& call)> on_slow = [](const RunningCall&) {};
    std::chrono::nanoseconds notice{0};  ///< 0: `on_slow` is not called.
    /// A call exceeds its limit; once for each.
    std::function<void(const RunningCall& call)> on_hang;
    /// The same call has still not returned; at each check.
    std::function<void(const RunningCall& call)> on_look = [](const RunningCall&) {};
    /// It has returned after all.
    std::function<void(const RunningCall& call)> on_return;
  };

  explicit Watchdog(Options options);
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;
  ~Watchdog();

 private:
  void watch();
  void look();

  const Options options_;
  const std::chrono::nanoseconds shortest_;  ///< Of limit and notice.
  // Its thread only.
  std::vector<RunningCall> hanging_;
  std::vector<RunningCall> slow_;  ///< Those that `on_slow` was called for, and that continue.

  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_stopping_ = false;

  std::vector<base::Refusal> refusals_;
  base::Thread thread_;
};

}  // namespace fastcycle::diagnostics

#pragma once

#include <atomic>
#include <csignal>
#include <functional>
#include <thread>

namespace fastcycle::tool {

/// Blocks SIGINT, SIGTERM, SIGHUP and SIGUSR1 in the calling thread, and so in all threads that it
/// creates afterwards. A SIGHUP that is ignored (`nohup`) stays ignored. Returns the blocked
/// signals.
sigset_t block_stop_signals();

/// A thread that waits for those signals: each SIGUSR1 calls `on_user`; the first of the others
/// calls `on_first`, the second ends the process with exit code 130 even if something hangs.
///
/// @threads  Confined to its owner; both callbacks run on its own thread.
class StopSignals {
 public:
  StopSignals(
      const sigset_t& signals, std::function<void()> on_first,
      std::function<void()> on_user = [] {});
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;
  ~StopSignals();

 private:
  void wait();

  const sigset_t signals_;
  const std::function<void()> on_first_;
  const std::function<void()> on_user_;
  std::atomic<bool> is_over_{false};
  std::thread thread_;
};

}  // namespace fastcycle::tool

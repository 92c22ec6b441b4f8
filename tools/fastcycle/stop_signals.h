#pragma once

#include <atomic>
#include <csignal>
#include <functional>
#include <thread>

namespace fastcycle::tool {

/// Blocks SIGINT, SIGTERM, SIGHUP and SIGUSR1 in the calling thread, and so in all that it makes
/// from now on. A SIGHUP that somebody wants ignored (`nohup`) stays ignored. Returns the signals
/// that are blocked.
sigset_t block_stop_signals();

/// A thread that waits for those signals: each SIGUSR1 calls `on_user`; of the others the first
/// calls `on_first`, the second ends the process with exit code 130, whatever hangs.
///
/// @threads  Confined to its owner; both are called on the thread of its own.
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

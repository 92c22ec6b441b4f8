#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <pthread.h>

namespace fastcycle::base {

/// `kIdle` (SCHED_IDLE) runs only on an idle CPU, and is preempted at once.
enum class SchedulingPolicy : std::uint8_t { kOther, kFifo, kRoundRobin, kIdle };

/// Scheduling of a thread. Options that the machine refuses are reported, not fatal.
struct ThreadOptions {
  std::string name;  ///< At most 15 bytes, the limit of the system, are used.
  std::vector<int> cpus;
  SchedulingPolicy policy = SchedulingPolicy::kOther;
  int priority = 0;  ///< 1 to 99 for FIFO and round robin.
  int slice_us = 0;  ///< The time slice with `kOther`, 100 to 100000; 0: the kernel's.
};

/// One thing that the machine refused, and how to grant it.
struct Refusal {
  std::string what;
  std::string remedy;
};

/// A thread with a small prefaulted stack (256 KiB), its name, affinity and policy set before its
/// body runs, and a timer slack of 1 ns, so that a timed wait of an ordinary thread is not 50 µs
/// late.
///
/// @threads  Confined to its owner.
class Thread {
 public:
  Thread() = default;

  /// Starts `body`; adds what the machine refused to `refusals` before this returns.
  ///
  /// @errors  std::system_error if no thread could be created.
  Thread(const ThreadOptions& options, std::function<void()> body, std::vector<Refusal>& refusals);

  Thread(Thread&& other) noexcept;
  Thread& operator=(Thread&& other) noexcept;
  Thread(const Thread&) = delete;
  Thread& operator=(const Thread&) = delete;

  /// @pre  It was joined, or never started.
  ~Thread();

  void join();

 private:
  pthread_t thread_{};
  bool is_joinable_ = false;
};

/// The size of every FastCycle thread's stack, in bytes.
inline constexpr std::size_t kStackSize = 256UL * 1024;

}  // namespace fastcycle::base

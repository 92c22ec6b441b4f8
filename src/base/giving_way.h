#pragma once

#include <atomic>

#include <sys/types.h>

namespace fastcycle::base {

/// How a thread lets all others go first while it does long work (SCHED_IDLE): it gets what they
/// leave, and its CPU counts as free for whoever is woken meanwhile.
///
///     GivingWay way;                       the thread:   way.adopt();
///                                                        way.begin(); copy(much); way.end();
///     someone else, who needs it done now:               way.hurry(true);
///
/// Between `begin` and `end` the thread may get no CPU for long. So it holds no lock there that
/// others want, and somebody who shares the CPUs as usual watches over it and calls `hurry`.
///
/// It does nothing to a thread of a real-time policy, and nothing where the machine does not let a
/// thread come back: that needs CAP_SYS_NICE, or a limit RLIMIT_NICE that allows to lower niceness.
///
/// @threads  `adopt`, `begin`, `end` by the thread; `hurry` by one other, as long as that one runs.
/// @realtime No lock, no allocation; one or two system calls, none if nothing changes.
class GivingWay {
 public:
  GivingWay() = default;
  GivingWay(const GivingWay&) = delete;
  GivingWay& operator=(const GivingWay&) = delete;

  /// Makes the calling thread the one that gives way.
  void adopt() noexcept;

  void begin() noexcept;
  void end() noexcept;

  /// With true it shares from now on, at once; with false it gives way again the next time.
  void hurry(bool is_hurried) noexcept;

 private:
  void share() const noexcept;

  std::atomic<pid_t> thread_{0};  ///< 0: none that could come back.
  std::atomic<int> policy_{0};    ///< As it was.
  std::atomic<bool> is_hurried_{false};
  bool is_giving_way_ = false;  ///< The thread's, as far as it knows.
};

}  // namespace fastcycle::base

#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "config/description.h"

namespace fastcycle::tool {

/// Ensures that a run ends after its end was requested. Constructors and destructors run on the
/// thread that builds and ends the run, so one that hangs would block it indefinitely. Reports such
/// a call and ends the process with exit code 1 once the call has taken longer than `kLimit` and
/// its component's `"lifecycle_limit_ms"`; never where that is 0.
///
/// @threads  `begin_within` is Safe.
class EndBound {
 public:
  static constexpr std::chrono::seconds kLimit{5};

  /// `leave` is called before the process ends. Both outlive it.
  EndBound(const config::ApplicationDescription& description, const char* command,
           std::function<void()> leave);
  EndBound(const EndBound&) = delete;
  EndBound& operator=(const EndBound&) = delete;
  ~EndBound();

  /// Starts to watch at `time`, or earlier if an earlier call said so.
  void begin_within(std::chrono::nanoseconds time);

 private:
  using Clock = std::chrono::steady_clock;

  void watch();
  void end_if_stuck() const;

  const config::ApplicationDescription& description_;
  const char* const command_;
  const std::function<void()> leave_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Clock::time_point> begin_;
  bool is_over_ = false;

  std::thread thread_;
};

}  // namespace fastcycle::tool

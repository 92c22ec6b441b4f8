#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "executor/actor_base.h"

namespace fastcycle::diagnostics {

/// A call of a component that has not returned, as seen from another thread.
struct RunningCall {
  const detail::ActorBase* actor = nullptr;
  std::string call;                  ///< `its callback for "speed"`
  std::string given;                 ///< `message 12 of "speed" from "wheels", …`; or empty.
  bool is_lifecycle = false;         ///< Constructor, `start()`, `stop()` and the like.
  std::uint64_t activation = 0;      ///< Its number; 0: none.
  std::int64_t begin_ns = 0;         ///< CLOCK_MONOTONIC; differs for each call.
  std::chrono::nanoseconds time{0};  ///< Its duration until now.
  std::string thread;                ///< Its name and number.
  std::vector<std::string> stack;    ///< Innermost first; empty if the thread did not answer.

  /// Number of frames up to the outermost one that is not of the framework or the system; 0 if
  /// there is none.
  [[nodiscard]] std::size_t own_frames() const;
  /// The innermost frame, and the innermost one of a component: `A::b+0x1 (liba.so+0x2)`.
  [[nodiscard]] std::string place() const;
  /// `its callback for "speed" (message 12 of …, activation 12) has not returned for 1.2 s`
  [[nodiscard]] std::string in_words() const;
};

/// The running calls of components that take longer than `least`, the longest first; for those
/// selected by `is_wanted` a signal makes the thread report its stack. A thread that blocks all
/// signals is reported without it after 1 s.
///
/// @threads  Safe; one caller after the other.
[[nodiscard]] std::vector<RunningCall> who_runs_now(
    std::chrono::nanoseconds least = {},
    const std::function<bool(const RunningCall&)>& is_wanted = [](const auto&) { return true; });

}  // namespace fastcycle::diagnostics

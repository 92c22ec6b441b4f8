#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "executor/actor_base.h"

namespace fastcycle::diagnostics {

/// A call of a component that has not returned, as it is seen from another thread.
struct RunningCall {
  const detail::ActorBase* actor = nullptr;
  std::string call;                  ///< `its callback for "speed"`
  std::string given;                 ///< `message 12 of "speed" from "wheels", …`; or empty.
  bool is_lifecycle = false;         ///< Constructor, `start()`, `stop()` and the like.
  std::uint64_t activation = 0;      ///< Its number; 0: it is none.
  std::int64_t begin_ns = 0;         ///< CLOCK_MONOTONIC; of each call another.
  std::chrono::nanoseconds time{0};  ///< That it took until now.
  std::string thread;                ///< Its name and number.
  std::vector<std::string> stack;    ///< Innermost first; empty if the thread did not answer.

  /// How many frames there are up to the outermost one that is no code of the framework or the
  /// system; 0: there is none.
  [[nodiscard]] std::size_t own_frames() const;
  /// The innermost frame, and the innermost one of a component: `A::b+0x1 (liba.so+0x2)`.
  [[nodiscard]] std::string place() const;
  /// `its callback for "speed" (message 12 of …, activation 12) has not returned for 1.2 s`
  [[nodiscard]] std::string in_words() const;
};

/// Which calls of components run now and take longer than `least`, the longest first; `is_wanted`
/// says which of them are to be looked at closely, by a signal that makes the thread say where it
/// stands. A thread that blocks all signals is named without that after 1 s.
///
/// @threads  Safe; one caller after the other.
[[nodiscard]] std::vector<RunningCall> who_runs_now(
    std::chrono::nanoseconds least = {},
    const std::function<bool(const RunningCall&)>& is_wanted = [](const auto&) { return true; });

}  // namespace fastcycle::diagnostics

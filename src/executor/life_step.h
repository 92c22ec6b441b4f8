#pragma once

#include <cstdint>

namespace fastcycle::detail {

/// What an activation of the life cycle (`Cause::kMode`) does: its key, in the log of the run.
enum class LifeStep : std::uint8_t {
  kOther,        ///< Posted only by tests and embedding programs.
  kStart,        ///< `start()`, and `activate()` if it is active in the first mode.
  kBeginTimers,  ///< The application has started.
  kActivate,
  kDeactivate,
  kEndTimers,  ///< The application stops.
  kStop,       ///< `stop()`.
  kClose,      ///< Nothing is delivered to it any more.
  kAlarm,      ///< A restart continues.
  kRenew,      ///< A tool restarts it,
  kToolStop,   ///< deactivates it,
  kToolStart,  ///< or activates it.
  kReload,     ///< Its object is replaced by one of another library,
  kRollBack,   ///< by one of the library before,
  kConfirm,    ///< or the library stays.
};

[[nodiscard]] constexpr std::uint64_t to_key(LifeStep step) noexcept {
  return static_cast<std::uint64_t>(step);
}

}  // namespace fastcycle::detail

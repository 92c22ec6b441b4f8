#pragma once

#include <cstdint>

namespace fastcycle::detail {

/// What an activation of the life cycle (`Cause::kMode`) does: its key, in the log of the run.
enum class LifeStep : std::uint8_t {
  kOther,        ///< What only tests and embedding programs post.
  kStart,        ///< `start()`, and `activate()` where the first mode has it active.
  kBeginTimers,  ///< The application has started.
  kActivate,
  kDeactivate,
  kEndTimers,  ///< The application stops.
  kStop,       ///< `stop()`.
  kClose,      ///< Nothing reaches it any more.
  kAlarm,      ///< A restart goes on.
  kRenew,      ///< A tool has it made anew,
  kToolStop,   ///< has it deactivated,
  kToolStart,  ///< or activated.
  kReload,     ///< Its object is replaced by one of another library,
  kRollBack,   ///< by one of the library before,
  kConfirm,    ///< or the library stays.
};

[[nodiscard]] constexpr std::uint64_t to_key(LifeStep step) noexcept {
  return static_cast<std::uint64_t>(step);
}

}  // namespace fastcycle::detail

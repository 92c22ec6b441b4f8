#pragma once

#include <cstdint>

namespace fastcycle::detail {

/// Life cycle state of a component.
enum class ComponentState : std::uint8_t {
  kDeclared,
  kConstructed,
  kStandby,     ///< Started, not active in the application's mode.
  kActive,      ///< Started; its callbacks are called.
  kRestarting,  ///< Waits for its reconstruction: after a fault, or until its threads end.
  kStopped,
  kFailed,
};

}  // namespace fastcycle::detail

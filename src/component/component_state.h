#pragma once

#include <cstdint>

namespace fastcycle::detail {

/// Where a component is in its life.
enum class ComponentState : std::uint8_t {
  kDeclared,
  kConstructed,
  kStandby,     ///< Started, not active in the application's mode.
  kActive,      ///< Started; its callbacks come.
  kRestarting,  ///< It waits to be made anew: after a fault, or for its threads to end.
  kStopped,
  kFailed,
};

}  // namespace fastcycle::detail

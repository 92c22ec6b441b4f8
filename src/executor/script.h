#pragma once

#include "executor/activation_ring.h"

namespace fastcycle::detail {

/// Drives a component that follows another one: executes the activations of that one, in the same
/// order.
///
/// @threads  As `Actor`.
class Script {
 public:
  Script() = default;
  Script(const Script&) = delete;
  Script& operator=(const Script&) = delete;
  virtual ~Script() = default;

  /// Executes the next activation if all that it needs is there; else false: then the component is
  /// marked when that has changed.
  virtual bool serve(ActivationRing& ring) = 0;
};

}  // namespace fastcycle::detail

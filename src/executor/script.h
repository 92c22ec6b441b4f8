#pragma once

#include "executor/activation_ring.h"

namespace fastcycle::detail {

/// What a component does that follows another one: the activations of that one, in its order, and
/// nothing by itself.
///
/// @threads  As `Actor`.
class Script {
 public:
  Script() = default;
  Script(const Script&) = delete;
  Script& operator=(const Script&) = delete;
  virtual ~Script() = default;

  /// Executes the next activation if all that it needs is there; false if it is not, or if there is
  /// none: then somebody marks the component when that has changed.
  virtual bool serve(ActivationRing& ring) = 0;
};

}  // namespace fastcycle::detail

#pragma once

#include "host/declared_wiring.h"

namespace fastcycle::host {

class Application;

/// The wiring of `application`, which was built.
[[nodiscard]] ApplicationWiring wiring_of(const Application& application);

}  // namespace fastcycle::host

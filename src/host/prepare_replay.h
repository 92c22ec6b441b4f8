#pragma once

#include <memory>

#include "config/description.h"
#include "config/problem.h"
#include "loading/component_classes.h"
#include "replay/replay.h"

namespace fastcycle::host {

/// As `Replay::prepare`: components declare their topics in their constructors, so the whole
/// application is built for it, and destroyed again.
[[nodiscard]] std::unique_ptr<Replay> prepare_replay(
    ReplayOptions options, const config::ApplicationDescription& application,
    ComponentClasses& classes, config::Problems& problems);

}  // namespace fastcycle::host

#pragma once

#include <functional>
#include <string>

#include "config/description.h"
#include "config/problem.h"
#include "loading/component_classes.h"
#include "loading/trial.h"

namespace fastcycle::host {

/// The `BuildForTrial` of a whole application.
[[nodiscard]] BuiltForTrial build_for_trial(
    config::ApplicationDescription description, ComponentClasses& classes,
    ConstructorFault on_throw, bool is_part,
    const std::function<void(const std::string& component)>& before_construct,
    config::Problems& problems);

}  // namespace fastcycle::host

#pragma once

#include "base/clock.h"
#include "component/component_host.h"
#include "config/description.h"
#include "record/recorder.h"

namespace fastcycle::host {

/// The description of a run that makes its log understandable on another machine: the application
/// with all values, the components by their numbers, the clock, and the machine.
[[nodiscard]] record::Explanation explain(const config::ApplicationDescription& description,
                                          const base::Clock& clock, const Components& components);

}  // namespace fastcycle::host

#pragma once

#include "record/recorder.h"

namespace fastcycle::host {

class Application;

/// What a log must say of the run that it is from, to be understood on another machine: the
/// application with all values, the components by their numbers, the clock, and the machine.
[[nodiscard]] record::Explanation explain(const Application& application);

}  // namespace fastcycle::host

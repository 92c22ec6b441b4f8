#pragma once

#include <vector>

#include "config/description.h"
#include "config/problem.h"
#include "config/value.h"

namespace fastcycle::config {

/// The plain values of an effective tree. A value that violates the schema keeps its default: the
/// error was reported with the file.
[[nodiscard]] ApplicationDescription describe(const Value& tree);

/// The processes that a tree describes, including those without components.
[[nodiscard]] std::vector<ProcessDescription> described_processes(const Value& tree);

/// Adds the errors of the application as a whole: duplicate or unknown names, contradictory values.
void check_sense(const ApplicationDescription& application, Problems& problems);

/// Adds an error for each fault to be injected that is incomplete or has keys without effect.
void check_faults(const ApplicationDescription& application, Problems& problems);

}  // namespace fastcycle::config

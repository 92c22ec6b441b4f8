#pragma once

#include <vector>

#include "config/description.h"
#include "config/problem.h"
#include "config/value.h"

namespace fastcycle::config {

/// The plain values of an effective tree. What has not the form that the schema wants keeps its
/// default: the mistake has been reported with the file.
[[nodiscard]] ApplicationDescription describe(const Value& tree);

/// The processes that a tree describes, also those that no component is in.
[[nodiscard]] std::vector<ProcessDescription> described_processes(const Value& tree);

/// Adds the mistakes that only the whole application shows: names that are used twice or not known,
/// values that contradict each other.
void check_sense(const ApplicationDescription& application, Problems& problems);

/// Adds a mistake for each fault to be injected that is not complete, or says what means nothing.
void check_faults(const ApplicationDescription& application, Problems& problems);

}  // namespace fastcycle::config

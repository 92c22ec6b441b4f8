#pragma once

#include <string>

#include "config/description.h"
#include "config/problem.h"
#include "record/flight_recorder.h"
#include "record/recorder.h"

namespace fastcycle::detail {
class ComponentCore;
class Topics;
}  // namespace fastcycle::detail

namespace fastcycle::host {

/// What `description` says, for a recorder.
[[nodiscard]] record::RecorderOptions recorder_options(
    const config::RecordDescription& description);

/// Warns of patterns that mean none of the topics.
void check_patterns(const config::RecordDescription& description, const detail::Topics& topics,
                    config::Problems& problems);

/// What `description` says, for a flight recorder.
[[nodiscard]] record::FlightOptions flight_options(
    const config::FlightRecorderDescription& description, const std::string& application);
void check_patterns(const config::FlightRecorderDescription& description,
                    const detail::Topics& topics, config::Problems& problems);

/// Records the application of `component`, which is being constructed; a mistake if it is recorded
/// already.
void record_for(detail::ComponentCore& component, const config::RecordDescription& description);

}  // namespace fastcycle::host

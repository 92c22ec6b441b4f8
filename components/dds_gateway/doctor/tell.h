#pragma once

#include <string>
#include <vector>

#include "dds_gateway/doctor/diagnosis.h"

namespace fastcycle::dds_gateway {

/// For people: each finding, and who is there with its topics; ends with a count of problems.
[[nodiscard]] std::string to_text(const Observation& seen, const std::vector<Finding>& findings);
/// One JSON object, indented: `findings`, `participants`, `endpoints`, `heard`, `round_trip_us`.
[[nodiscard]] std::string to_json(const Observation& seen, const std::vector<Finding>& findings);

}  // namespace fastcycle::dds_gateway

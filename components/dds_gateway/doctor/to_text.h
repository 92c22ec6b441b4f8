#pragma once

#include <string>
#include <vector>

#include "dds_gateway/doctor/diagnosis.h"

namespace fastcycle::dds_gateway {

/// As text: all findings, and the participants with their topics; ends with the number of problems.
[[nodiscard]] std::string to_text(const Observation& seen, const std::vector<Finding>& findings);
/// One JSON object, indented: `findings`, `participants`, `endpoints`, `received`, `round_trip_us`.
[[nodiscard]] std::string to_json(const Observation& seen, const std::vector<Finding>& findings);

}  // namespace fastcycle::dds_gateway

#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/description.h"
#include "report/report.h"

namespace fastcycle::host {

/// Serializes the report of one process for the one that combines them: the same program, so that
/// the format needs no version.
[[nodiscard]] std::string to_bytes(const RunReport& report);
/// @errors  std::runtime_error if they are not a result of `to_bytes`.
[[nodiscard]] RunReport report_from_bytes(std::string_view bytes);

/// Combines the reports of all processes; `parts` begins with that of the main process. Components
/// come in the order of the application's file.
[[nodiscard]] RunReport put_together(std::vector<RunReport> parts,
                                     const config::ApplicationDescription& application);

}  // namespace fastcycle::host

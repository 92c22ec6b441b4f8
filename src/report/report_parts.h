#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/description.h"
#include "report/report.h"

namespace fastcycle::host {

/// What one process says of a run, as bytes for the one that puts the parts together: of the same
/// program, so that nothing has to be told of their format.
[[nodiscard]] std::string to_bytes(const RunReport& report);
/// @errors  std::runtime_error if these are not what `to_bytes` gave.
[[nodiscard]] RunReport report_from_bytes(std::string_view bytes);

/// One report of all processes: `parts` holds what each said, that of the main process first.
/// Components come in the order of the application's file.
[[nodiscard]] RunReport put_together(std::vector<RunReport> parts,
                                     const config::ApplicationDescription& application);

}  // namespace fastcycle::host

#pragma once

#include <filesystem>

#include "config/problem.h"
#include "estimate/timing.h"

namespace fastcycle::estimate {

/// Merges `file` over `timing`: a file of timing; or the report of a run, or a recording (`.mcap`),
/// whose longest callbacks are multiplied by `margin`.
///
/// @errors  Into `problems`, with file, pointer, expected and found.
void read_timing(const std::filesystem::path& file, double margin, Timing& timing,
                 config::Problems& problems);

}  // namespace fastcycle::estimate

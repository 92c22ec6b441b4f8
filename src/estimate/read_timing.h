#pragma once

#include <filesystem>

#include "config/problem.h"
#include "estimate/timing.h"

namespace fastcycle::estimate {

/// Adds what `file` says, over what there is: a file of timing; or the report of a run, or a
/// recording (`.mcap`), whose longest callbacks are taken `margin` times.
///
/// @errors  Into `problems`, with file, pointer, expected and found.
void read_timing(const std::filesystem::path& file, double margin, Timing& timing,
                 config::Problems& problems);

}  // namespace fastcycle::estimate

#pragma once

#include <filesystem>

#include "config/problem.h"
#include "estimate/timing.h"

namespace fastcycle::estimate {

/// Merges over `timing` the longest activation of each callback in a recording, multiplied by
/// `margin`.
///
/// @errors  Into `problems`: that it cannot be read, or has no activations.
void read_recorded_timing(const std::filesystem::path& file, double margin, Timing& timing,
                          config::Problems& problems);

}  // namespace fastcycle::estimate

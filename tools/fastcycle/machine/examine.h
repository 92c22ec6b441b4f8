#pragma once

#include <chrono>

#include "file_work.h"

namespace fastcycle::tool::machine {

/// `fastcycle doctor` without a file: examines the limits and settings of this machine, measures
/// for `time` the wake-up latency of each way of waiting, and recommends improvements. Returns the
/// exit code.
int examine(std::chrono::nanoseconds time, bool is_json, Output& output);

}  // namespace fastcycle::tool::machine

#pragma once

#include <chrono>

#include "file_work.h"

namespace fastcycle::tool::machine {

/// `fastcycle doctor` without a file: what this machine allows, how late a thread wakes up on it
/// now, and what would be better. Measures for `time` each way of waking up. Returns the exit code.
int examine(std::chrono::nanoseconds time, bool is_json, Output& output);

}  // namespace fastcycle::tool::machine

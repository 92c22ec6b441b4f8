#pragma once

#include "config/problem.h"
#include "config/value.h"

namespace fastcycle::config {

/// Adds what the processes of an effective tree require and this machine lacks: users are errors;
/// CPUs, and files and folders of a sandbox, are warnings.
void check_machine(const Value& tree, Problems& problems);

}  // namespace fastcycle::config

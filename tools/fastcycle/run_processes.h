#pragma once

#include <csignal>

#include "config/description.h"
#include "loading/component_library.h"
#include "loading/trial.h"
#include "report_file.h"
#include "run.h"

namespace fastcycle::tool {

/// Runs an application whose components are in several processes: this one makes the others.
/// Returns the exit code.
[[nodiscard]] int run_processes(const config::ApplicationDescription& description,
                                const host::TrialResult& tried, host::LibraryLoader& libraries,
                                const sigset_t& signals, const RunOptions& options,
                                const ReportFile& report_file);

}  // namespace fastcycle::tool

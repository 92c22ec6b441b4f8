// In place of run_processes.cc and following.cc, in a build that runs all components in one
// process.

#include "command.h"
#include "print.h"
#include "run_processes.h"

namespace fastcycle::tool {

int run_processes(const config::ApplicationDescription& /*description*/,
                  const host::TrialResult& /*tried*/, host::LibraryLoader& /*libraries*/,
                  const sigset_t& /*signals*/, const RunOptions& options,
                  const ReportFile& /*report_file*/) {
  print_to(
      stderr,
      "fastcycle {}: this build runs all components in one process; `./dev demo --isolate all` "
      "builds what several need\n",
      options.command);
  return kWrong;
}

}  // namespace fastcycle::tool

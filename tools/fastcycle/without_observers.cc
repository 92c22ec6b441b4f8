// In place of run_observers.cc and live/graph.cc, in a build without what shows a run while it
// happens.

#include "live/graph.h"
#include "run_observers.h"

namespace fastcycle::tool {

struct RunObservers::Observers {};

std::string RunObservers::find_absent(const RunOptions& options,
                                      const config::ApplicationDescription& description) {
  if (options.inspect.is_wanted(description) || options.live.describe(description) ||
      options.trace.describe(description)) {
    return "this build has no --inspect, --live and --trace; `./dev demo` with one of them builds "
           "them";
  }
  return {};
}

RunObservers::RunObservers(const RunOptions& /*options*/,
                           const config::ApplicationDescription& /*description*/) {}

RunObservers::~RunObservers() = default;

void RunObservers::add_servers(host::Application& /*application*/, const Played& /*played*/,
                               bool /*has_processes*/) {}

void RunObservers::add_trace(host::Application& /*application*/) {}

std::vector<std::string> RunObservers::addresses() const {
  return {};
}

std::vector<host::ToolReport> RunObservers::reports() const {
  return {};
}

std::string RunObservers::trace_problem() const {
  return {};
}

void live::GraphOptions::add_to(CLI::App& /*line*/) {}

int live::GraphOptions::run(const CLI::App& /*line*/, const std::function<int()>& of_file,
                            const std::function<int(const std::string& dot)>& /*write*/) const {
  return of_file();
}

}  // namespace fastcycle::tool

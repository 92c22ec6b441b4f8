#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/description.h"
#include "host/application.h"
#include "host/pace.h"
#include "host/prepare_replay.h"
#include "report/report.h"
#include "run.h"

namespace fastcycle::tool {

/// What shows a run while it happens: the inspection for tools, the live server for browsers and
/// Foxglove, and the trace. Each is there if the options or the application ask for it.
///
///     RunObservers observers(options, description);
///     host::Application application(…);
///     observers.add_servers(application, played);
///     application.record(…);
///     observers.add_trace(application);
///
/// @threads  Confined. Must outlive the application.
class RunObservers {
 public:
  /// What is played, whose pace clients may set.
  struct Played {
    host::WallPace* pace = nullptr;
    const host::Replay* replay = nullptr;
  };

  /// An error message if the run asks for something that this build lacks; else empty.
  [[nodiscard]] static std::string find_absent(const RunOptions& options,
                                               const config::ApplicationDescription& description);

  RunObservers(const RunOptions& options, const config::ApplicationDescription& description);
  ~RunObservers();
  RunObservers(const RunObservers&) = delete;
  RunObservers& operator=(const RunObservers&) = delete;

  /// Before the tools that record what the inspection publishes. `has_processes`: clients may ask
  /// for the news of standbys.
  void add_servers(host::Application& application, const Played& played, bool has_processes);
  /// Behind the recorder.
  void add_trace(host::Application& application);

  /// Where the live server is reached, in lines for the terminal.
  [[nodiscard]] std::vector<std::string> addresses() const;
  /// The results after the run.
  [[nodiscard]] std::vector<host::ToolReport> reports() const;
  /// Why the trace is incomplete; empty if it is not.
  [[nodiscard]] std::string trace_problem() const;

 private:
  struct Observers;
  const std::unique_ptr<Observers> observers_;
};

}  // namespace fastcycle::tool

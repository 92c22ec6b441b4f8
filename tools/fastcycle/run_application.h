#pragma once

#include <csignal>
#include <memory>
#include <string>

#include "base/clock.h"
#include "component/peers.h"
#include "config/description.h"
#include "config/problem.h"
#include "host/application.h"
#include "loading/component_classes.h"
#include "loading/component_library.h"
#include "report/report.h"
#include "report_file.h"
#include "run.h"

namespace fastcycle::tool {

/// An application that is connected to the other processes. It must not outlive the application.
///
/// @threads  Confined to the control thread.
class ConnectedRun {
 public:
  ConnectedRun() = default;
  ConnectedRun(const ConnectedRun&) = delete;
  ConnectedRun& operator=(const ConnectedRun&) = delete;
  virtual ~ConnectedRun() = default;

  virtual void report_started() = 0;
  virtual void report_ended(host::EndReason reason) = 0;
  /// Adds what is known about this process, and passes the report on. The application has stopped.
  virtual void pass_on(host::RunReport report) = 0;
};

/// The differences for one process of an application with several.
///
/// @threads  Confined to the control thread, but for `request_end`.
class ProcessRole {
 public:
  ProcessRole() = default;
  ProcessRole(const ProcessRole&) = delete;
  ProcessRole& operator=(const ProcessRole&) = delete;
  virtual ~ProcessRole() = default;

  [[nodiscard]] virtual host::Peers& peers() = 0;
  [[nodiscard]] virtual host::ComponentClasses& classes() = 0;
  /// The clock of all processes; null in simulated time.
  [[nodiscard]] virtual const base::Clock* clock() const = 0;
  /// The replay, the same in all processes; null if there is none. Call once.
  [[nodiscard]] virtual std::unique_ptr<host::Replay> take_replay() = 0;
  /// Ends the run in all processes. Any thread.
  virtual void request_end(host::EndReason reason) = 0;
  /// Connects the application, which was built, and waits for the other processes; null if the run
  /// does not start.
  [[nodiscard]] virtual std::unique_ptr<ConnectedRun> connect(host::Application& application) = 0;
};

/// Builds and runs an application that was found to be right; with a `role`, as one process of
/// several. Returns the exit code.
[[nodiscard]] int run_application(const config::ApplicationDescription& description,
                                  host::LibraryLoader& libraries, const sigset_t& signals,
                                  const RunOptions& options, const ReportFile& report_file,
                                  ProcessRole* role = nullptr);

[[nodiscard]] host::ClockOptions clock_of(const RunOptions& options);

/// The trial has reported the warnings.
[[nodiscard]] config::Problems without_warnings(const config::Problems& problems);

/// Prints the table and writes the file, where they are wanted. Returns why the latter was not
/// written, or nothing.
[[nodiscard]] std::string put_report(const host::RunReport& report, const RunOptions& options,
                                     const ReportFile& report_file);

[[nodiscard]] bool has_faults(const host::RunReport& report);

}  // namespace fastcycle::tool

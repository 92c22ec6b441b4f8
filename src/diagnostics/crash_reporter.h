#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "diagnostics/crash_note.h"
#include "executor/activation_ring.h"
#include "fastcycle/message.h"

namespace fastcycle::detail {
class LogQueue;
class PublisherCore;
}  // namespace fastcycle::detail

namespace fastcycle::diagnostics {

/// Data about a run for crash reports.
struct RunFacts {
  struct Component {
    std::string name;
    std::string library;  ///< `planner` for `libplanner.so`; empty: the framework's own.
  };
  struct Publisher {
    PublisherId id = 0;
    std::string topic;
    std::string component;
    const detail::PublisherCore* core = nullptr;  ///< Outlives the reporter; or none.
  };

  std::string application;
  std::filesystem::path folder;       ///< Where the report goes; empty: only to standard error.
  std::vector<Component> components;  ///< In the order of the application file.
  std::vector<Publisher> publishers;
  std::vector<const detail::ActivationRing*> rings;
  CrashNote* note = nullptr;  ///< Filled in by the crash; or none.
  /// Where the crash stores the index + 1 of the component whose activation it was in; or null.
  std::atomic<std::uint32_t>* crashed = nullptr;
  const detail::LogQueue* log = nullptr;  ///< Its lines are printed before the end; or null.
};

/// Reports the component at fault when the process ends by SIGSEGV, SIGBUS, SIGFPE, SIGILL,
/// SIGABRT, `std::terminate`, or by `exit`, `quick_exit` or `_exit` from within a component:
/// component, call and message, the backtrace of the thread, and the last activations of all
/// components. It is written to standard error and to a file of its own,
/// `fastcycle-crash-NAME-PID.txt`.
///
/// Waiting lines of the log have a tenth of a second to be printed.
///
/// After the report of a signal the process ends as it would have without one, with a core file if
/// those are enabled. A call of `exit` ends with exit code 1.
///
/// A report contains no data of messages.
///
/// @threads  One of the process at a time. Reports are made on the thread that crashed, with
///           async-signal-safe functions only.
class CrashReporter {
 public:
  CrashReporter();
  CrashReporter(const CrashReporter&) = delete;
  CrashReporter& operator=(const CrashReporter&) = delete;
  ~CrashReporter();

  /// Sets the data for reports. Earlier data is not freed.
  void know(RunFacts facts);
};

/// Ends the process at once, as `_exit`; no report of it is made.
[[noreturn]] void end_process(int exit_code) noexcept;

/// Writes the whole report of the calling thread, as of a crash for `reason`, and ends the process
/// with `exit_code`. Without a reporter it only ends the process.
[[noreturn]] void report_and_end(const char* reason, int exit_code) noexcept;

}  // namespace fastcycle::diagnostics

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

/// What a crash report knows of a run, beside what the crash itself shows.
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
  std::vector<Component> components;  ///< By their places in the application file.
  std::vector<Publisher> publishers;
  std::vector<const detail::ActivationRing*> rings;
  CrashNote* note = nullptr;  ///< Filled in by the crash; or none.
  /// Where the crash says in whose activation it was: the component's place + 1; or none.
  std::atomic<std::uint32_t>* crashed = nullptr;
  const detail::LogQueue* log = nullptr;  ///< Whose lines are printed before the end; or none.
};

/// Says who is to blame when the process ends by SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT,
/// `std::terminate`, or by `exit`, `quick_exit` or `_exit` from within a component: component, call
/// and message, the backtrace of the thread, and what all components did last. It goes to standard
/// error and into a file of its own, `fastcycle-crash-NAME-PID.txt`.
///
/// Lines of the log that wait to be printed get a tenth of a second for that.
///
/// After the report of a signal the process ends as it would have without one, with a core file
/// where those are allowed. What ends in `exit` ends with exit code 1.
///
/// Nothing of a report comes from messages.
///
/// @threads  One of the process at a time. What it reports it does on the thread that crashed,
///           with what a signal handler may use.
class CrashReporter {
 public:
  CrashReporter();
  CrashReporter(const CrashReporter&) = delete;
  CrashReporter& operator=(const CrashReporter&) = delete;
  ~CrashReporter();

  /// From now on reports know this. Those of before stay in memory.
  void know(RunFacts facts);
};

/// Ends the process at once, as `_exit`; no report of it is made.
[[noreturn]] void end_process(int exit_code) noexcept;

/// Writes the whole report of the calling thread, as of a crash for `reason`, and ends the process
/// with `exit_code`. Without a reporter it only ends the process.
[[noreturn]] void report_and_end(const char* reason, int exit_code) noexcept;

}  // namespace fastcycle::diagnostics

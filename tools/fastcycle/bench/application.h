#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/thread.h"
#include "bench/options.h"
#include "fastcycle/component.h"
#include "host/application.h"
#include "measure/usage.h"
#include "report/report.h"
#include "trace/tracer.h"

namespace fastcycle::tool::bench {

using Json = nlohmann::ordered_json;

// The pieces of an application file, as `fastcycle run` accepts it.

/// Two executors on one machine: with SCHED_FIFO and `spin` each gets a CPU, named by `place`.
[[nodiscard]] Json executor(const Options& options, const std::string& name,
                            const std::string& wait, int place);
[[nodiscard]] Json component(const std::string& name, const std::string& library,
                             const std::string& executor, Json params);
[[nodiscard]] Json application(Json executors, Json components);

/// The params of `benchmark_source` for one point.
[[nodiscard]] Json source(const Options& options, std::int64_t size);
/// A `benchmark_sink` whose queue holds a few of these payloads.
[[nodiscard]] Json sink(const Options& options, const std::string& name, std::int64_t size);
/// Makes `component` write its stamps into `folder`; nothing without a folder.
void write_samples_to(Json& component, const std::string& folder);

/// When each step of a run was completed, CLOCK_MONOTONIC.
struct Stages {
  std::int64_t begin_ns = 0;
  std::int64_t read_ns = 0;     ///< The JSON file.
  std::int64_t built_ns = 0;    ///< Libraries loaded, components constructed, topics connected.
  std::int64_t started_ns = 0;  ///< Components started, timers run.
  std::int64_t stopped_ns = 0;  ///< Components stopped; what is recorded is on the disk.
};

/// The results of a run that has ended.
struct Finished {
  host::RunReport report;
  std::optional<trace::TraceReport> trace;
  std::map<std::string, std::map<std::string, ReportValue, std::less<>>> results;
  std::vector<base::Refusal> refusals;
  Stages stages;
  std::int64_t clock_offset_ns = 0;  ///< The application's clock minus CLOCK_MONOTONIC, live.

  [[nodiscard]] double number(const std::string& component, const std::string& name) const;
  [[nodiscard]] std::int64_t whole(const std::string& component, const std::string& name) const;
  /// The resource usage of the process that `component` reports.
  [[nodiscard]] measure::Usage usage(const std::string& component) const;
  /// The sum over all components that report it.
  [[nodiscard]] std::int64_t sum(const std::string& name) const;
};

/// Callbacks at certain points of a run.
struct RunHooks {
  host::ClockOptions clock = {};
  std::optional<Duration> limit = {};
  std::function<void(host::Application&)> before_build = {};
  std::function<void()> after_start = {};
  std::function<void()> before_stop = {};
};

/// Runs applications one after the other as `fastcycle run` does: read from a file, with libraries
/// loaded and components constructed by the host.
///
/// @threads  `request_end` is Safe; all else is confined to its owner.
class Runner {
 public:
  /// @errors  std::runtime_error with all diagnostics if it did not start or did not end well.
  [[nodiscard]] Finished run(const Json& json, const std::string& folder,
                             const RunHooks& hooks = {});

  /// Ends the application that is running now.
  void request_end();

 private:
  class Announcement;

  std::mutex mutex_;
  host::Application* running_ = nullptr;
  bool is_ended_ = false;
};

/// Runs an application with `fastcycle run`, in separate processes, and returns its report.
///
/// @errors  std::runtime_error with its output if it did not end well.
[[nodiscard]] Json run_program(const Json& json, const std::string& folder);

}  // namespace fastcycle::tool::bench

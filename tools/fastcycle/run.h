#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "configuration.h"
#include "flight_options.h"
#include "inspect_options.h"
#include "live_options.h"
#include "recording_options.h"
#include "replaying_options.h"
#include "tracing_options.h"

namespace fastcycle::tool {

/// The options of the commands that run an application.
struct RunOptions {
  const char* command = "run";
  Configuration configuration;
  std::string limit;
  std::string clock = "live";
  std::optional<double> rate;
  std::optional<unsigned> workers;
  bool is_strict = false;
  bool fails_on_fault = false;
  bool is_debuggable = false;
  bool is_quiet = false;
  std::string log_level;
  std::filesystem::path report;
  RecordingOptions record;
  FlightOptions flight_recorder;
  InspectOptions inspect;
  LiveOptions live;
  TracingOptions trace;
  ReplayingOptions replay;
  bool is_played = false;  ///< Simulated time at the pace of the wall, with keys.
  double play_rate = 1.0;
};

/// Limits of the speed factor of what is played.
inline constexpr double kMinRate = 1e-3;
inline constexpr double kMaxRate = 1e3;

/// The end of the help of each of these commands.
inline constexpr const char* kEnds =
    "\n"
    "The first Ctrl-C ends the run normally, with table and report; the second immediately.\n"
    "Exit codes: 0 done, 1 the run failed, 2 wrong input (nothing was started), 130 ended\n"
    "immediately.\n";

/// The common options of all commands that run an application.
void add_options(CLI::App& line, RunOptions& options);

/// How time passes, of `run` and `record`.
void add_clock_options(CLI::App& line, RunOptions& options);

/// The files that the run reads, which it must not overwrite.
[[nodiscard]] std::vector<std::filesystem::path> inputs_of(const RunOptions& options);

/// Returns the exit code.
[[nodiscard]] int run(const RunOptions& options);

}  // namespace fastcycle::tool

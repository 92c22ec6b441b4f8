#include "run.h"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/log_level.h"
#include "command.h"
#include "duration.h"
#include "loading/component_library.h"
#include "loading/protection.h"
#include "option_values.h"
#include "print.h"
#include "report_file.h"
#include "run_application.h"
#include "run_observers.h"
#include "run_processes.h"
#include "stop_signals.h"

namespace fastcycle::tool {

std::vector<std::filesystem::path> inputs_of(const RunOptions& options) {
  std::vector<std::filesystem::path> inputs = options.configuration.load.overlays;
  inputs.push_back(options.configuration.load.file);
  inputs.insert(inputs.end(), options.replay.files.begin(), options.replay.files.end());
  return inputs;
}

namespace {

/// Reports two outputs in one file, of which one would be lost; empty if there are none.
std::string find_shared_output(const RunOptions& options) {
  std::map<std::filesystem::path, const char*> known;
  for (const auto& [option, file] :
       {std::pair("--report", options.report), std::pair("--record", options.record.file),
        std::pair("--flight-recorder", options.flight_recorder.file),
        std::pair("--trace", options.trace.file)}) {
    std::error_code error;
    const bool is_stream = std::filesystem::is_other(file, error);
    const std::filesystem::path place = std::filesystem::weakly_canonical(file, error);
    if (file.empty() || is_stream || error) {
      continue;
    }
    if (const auto [other, is_new] = known.emplace(place, option); !is_new) {
      return fmt::format("{} and {} are both \"{}\"; give each a file of its own", other->second,
                         option, file.string());
    }
  }
  return {};
}

/// Reports options that contradict each other; empty if none do.
std::string find_wrong(const RunOptions& options) {
  if (!options.limit.empty() && !parse_duration(options.limit)) {
    return "--for expects a time above zero with its unit, as 500ms, 10s, 2min or 1h, and not \"" +
           options.limit + "\"";
  }
  if (options.clock != "live" && options.clock != "simulated") {
    return "--clock is \"live\" or \"simulated\", not \"" + options.clock + "\"";
  }
  const bool is_simulated = options.clock == "simulated";
  if (is_simulated && options.rate) {
    return "--rate requires --clock live; simulated time runs as fast as the components compute";
  }
  if (!is_simulated && options.workers) {
    return "--workers requires --clock simulated; with the clock \"live\", the application's "
           "\"executors\" define the workers";
  }
  if (options.rate && !(*options.rate >= kMinRate && *options.rate <= kMaxRate)) {
    return "--rate expects a number from 0.001 to 1000";
  }
  if (!(options.play_rate >= kMinRate && options.play_rate <= kMaxRate)) {
    return "--rate expects a number from 0.001 to 1000";
  }
  for (const std::string& sentence :
       {options.record.find_wrong(), options.replay.find_wrong(), find_shared_output(options)}) {
    if (!sentence.empty()) {
      return sentence;
    }
  }
  if (options.workers && (*options.workers == 0 || *options.workers > kMaxWorkers)) {
    return "--workers expects a number from 1 to " + std::to_string(kMaxWorkers);
  }
  return {};
}

}  // namespace

int run(const RunOptions& options) {
  const auto wrong = [&](const std::string& sentence) {
    print_to(stderr, "fastcycle {}: {}\n", options.command, sentence);
    return static_cast<int>(kWrong);
  };
  if (const std::string sentence = find_wrong(options); !sentence.empty()) {
    return wrong(sentence);
  }
  const ReportFile report_file(options.report, inputs_of(options));
  if (const std::string obstacle = report_file.find_obstacle(); !obstacle.empty()) {
    return wrong("the report " + options.report.string() + " cannot be written: " + obstacle);
  }
  if (options.is_debuggable) {
    host::unprotect_process();
  } else if (const auto obstacle = host::protect_process()) {
    return wrong(*obstacle);
  }
  config::Problems problems;
  host::TrialResult tried;
  config::ApplicationDescription description = options.configuration.read(
      host::ConstructorFault::kFault, problems,
      options.replay.files.empty() ? Configuration::TrialWarnings::kReported
                                   : Configuration::TrialWarnings::kLeftOut,
      &tried);
  if (!may_start(problems, options.configuration.load.file.string())) {
    return kWrong;
  }
  if (!options.log_level.empty()) {
    const auto& words = detail::kLogLevelWords;
    description.log_level =
        static_cast<LogLevel>(std::ranges::find(words, options.log_level) - words.begin());
  }
  if (options.record.has_settings() && !options.record.describe(description)) {
    return wrong("--record-topics and --record-compression require --record FILE");
  }
  if (const std::string sentence = options.flight_recorder.find_wrong(description);
      !sentence.empty()) {
    return wrong(sentence);
  }
  const bool is_live = options.live.describe(description).has_value();
  if (const std::string sentence = options.inspect.find_wrong(description, is_live);
      !sentence.empty()) {
    return wrong(sentence);
  }
  if (const std::string sentence = options.live.find_wrong(); !sentence.empty()) {
    return wrong(sentence);
  }
  if (const std::string sentence = RunObservers::find_absent(options, description);
      !sentence.empty()) {
    return wrong(sentence);
  }
  host::LibraryLoader libraries(
      host::library_folders(description, options.configuration.library_path),
      description.libraries);
  libraries.expect(tried.files);
  // A reader of the log that goes away must not end the run.
  std::signal(SIGPIPE, SIG_IGN);
  // Before any other thread is made, so that none of them is interrupted.
  const sigset_t signals = block_stop_signals();
  const bool is_simulated = clock_of(options).is_simulated;
  const bool has_standbys =
      std::ranges::any_of(description.processes, &config::ProcessDescription::has_standby);
  if (is_simulated && (has_standbys || !description.shadows.empty())) {
    print_to(stderr,
             "fastcycle {}: simulated time does not support standbys and shadows; `fastcycle "
             "compare` executes a recorded drive with another library\n",
             options.command);
  }
  const bool has_shadows = !description.shadows.empty() && !is_simulated;
  if (description.processes.empty() && !has_shadows) {
    return run_application(description, libraries, signals, options, report_file);
  }
  return run_processes(description, tried, libraries, signals, options, report_file);
}

namespace {

/// The arguments do not mark the end of the recordings: the last file is the application.
int play(RunOptions& options) {
  std::vector<std::filesystem::path>& files = options.replay.files;
  if (files.size() < 2) {
    print_text(stderr, "fastcycle play: expects recordings, followed by an application\n");
    return kWrong;
  }
  options.configuration.load.file = files.back();
  files.pop_back();
  return run(options);
}

}  // namespace

void add_clock_options(CLI::App& line, RunOptions& options) {
  line.add_option(
          "--clock", options.clock,
          "The machine's clock, or simulated time, which runs as fast as the components compute")
      ->type_name("live|simulated");
  line.add_option("--rate", options.rate, "Live only: speed factor of time")->type_name("X");
}

void add_options(CLI::App& line, RunOptions& options) {
  options.configuration.add_to(line);
  line.add_option("--for", options.limit, "End after this application time: 500ms, 10s, 2min, 1h")
      ->type_name("TIME");
  line.add_option("--workers", options.workers,
                  options.is_played
                      ? "Number of threads; the result does not depend on it"
                      : "Simulated only: number of threads; the result does not depend on it")
      ->type_name("N");
  line.add_option("--log-level", options.log_level,
                  "Minimum level of log lines, instead of the application's \"log_level\" (info); "
                  "components with their own \"log_level\" keep it")
      ->type_name("LEVEL")
      ->check(is_one_of({detail::kLogLevelWords.begin(), detail::kLogLevelWords.end()}));
  line.add_option("--report", options.report, "Write a report of the run, as JSON")
      ->type_name("FILE");
  line.add_option("--flight-recorder", options.flight_recorder.file,
                  "Keep the last messages in this file, which survives a crash")
      ->type_name("FILE.ring");
  line.add_option("--flight-recorder-mb", options.flight_recorder.size_mb,
                  "Size of the flight recorder, in MB (that of the application, else 256)")
      ->type_name("MB");
  options.inspect.add_to(line);
  line.add_option("--trace", options.trace.file,
                  "Trace the activity of the components to this file, for ui.perfetto.dev")
      ->type_name("FILE.pftrace");
  line.add_flag("--strict", options.is_strict,
                "Fail if the machine refuses priorities, CPUs or locked memory");
  line.add_flag("--fail-on-fault", options.fails_on_fault,
                "End with exit code 1 if any component faulted, whatever its \"on_fault\"");
  line.add_flag("--quiet", options.is_quiet, "Print no progress line and no table");
  line.add_flag(
      "--debuggable", options.is_debuggable,
      "Give debuggers and core dumps access to the process's memory, including all messages");
}

Command add_run(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "run", "Run an application until its input ends, its time limit, or Ctrl-C");
  line->footer(examples(std::string("  fastcycle run app.json\n"
                                    "  fastcycle run app.json --for 10s --report run.json\n"
                                    "  fastcycle run app.json --set limiter.limit_mps=20 "
                                    "--overlay vehicle_17.json\n"
                                    "  fastcycle run app.json --clock simulated --var "
                                    "data=drives/0042\n"
                                    "  fastcycle run app.json --record drive.mcap "
                                    "--record-topics 'control/*'\n"
                                    "  fastcycle run app.json --for 10s --trace drive.pftrace\n"
                                    "  fastcycle run app.json --replay drive.mcap --clock "
                                    "simulated\n") +
                        kEnds));
  const auto options = std::make_shared<RunOptions>();
  add_options(*line, *options);
  options->live.add_to(*line);
  add_clock_options(*line, *options);
  line->add_option("--record", options->record.file, "Record all topics to an MCAP file")
      ->type_name("FILE.mcap");
  line->add_option("--record-topics", options->record.topics,
                   "Record only topics that match: control/*, camera/** (repeatable)")
      ->type_name("PATTERN");
  line->add_option("--record-compression", options->record.compression,
                   "Compression of the file (that of the application, else lz4)")
      ->type_name("none|lz4|zstd");
  line->add_option("--replay", options->replay.files,
                   "Replay the messages of this file, at their times, instead of running the "
                   "components that published them. Repeatable: the files of one recording")
      ->allow_extra_args(false)
      ->type_name("FILE.mcap");
  options->replay.add_target_to(*line);
  return {line, [options] { return run(*options); }};
}

Command add_play(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("play", "Play recordings into an application, in real time");
  line->footer(
      examples(std::string("  fastcycle play drive.mcap app.json\n"
                           "  fastcycle play drive_0001.mcap drive_0002.mcap app.json --rate 4\n"
                           "  fastcycle play drive.mcap app.json --start 12 --end 20 --loop\n"
                           "  fastcycle play drive.mcap app.json --replay-into localization\n"
                           "  fastcycle play other.mcap app.json --remap imu/data:=imu/gyro\n"
                           "\n"
                           "On a terminal: space pauses, . or s executes one step, + and -\n"
                           "change the rate, q ends.\n") +
               kEnds));
  const auto options = std::make_shared<RunOptions>();
  options->command = "play";
  options->is_played = true;
  options->clock = "simulated";
  line->add_option("recording", options->replay.files,
                   "The files of one recording, then the application's JSON file")
      ->required()
      ->type_name("FILE.mcap");
  add_options(*line, *options);
  options->live.add_to(*line);
  line->get_option("application")->required(false);  // The last of the files: see `play`.
  line->add_option("--rate", options->play_rate, "Speed factor of time")->type_name("X");
  line->add_option("--record", options->record.file, "Record all topics to an MCAP file")
      ->type_name("FILE.mcap");
  options->replay.add_target_to(*line);
  options->replay.add_selection_to(*line);
  return {line, [options] { return play(*options); }};
}

}  // namespace fastcycle::tool

#include "run_application.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "command.h"
#include "duration.h"
#include "end_bound.h"
#include "host/diagnosis.h"
#include "host/pace.h"
#include "host/prepare_replay.h"
#include "host/recording.h"
#include "loading/protection.h"
#include "print.h"
#include "progress_line.h"
#include "report/report_parts.h"
#include "run_observers.h"
#include "service_manager.h"
#include "stop_signals.h"
#include "terminal_keys.h"
#include "terminal_modes.h"

namespace fastcycle::tool {

namespace {

constexpr std::chrono::seconds kStartLimit{10};  ///< For all starts, in addition to --for.

/// Says, each thing once, what the machine refused.
void print(const std::vector<base::Refusal>& refusals, ProgressLine& progress) {
  std::set<std::string> said;
  for (const base::Refusal& refusal : refusals) {
    const std::string text = "refused: " + refusal.what + "; " + refusal.remedy;
    if (said.insert(text).second) {
      progress.print(text);
    }
  }
}

/// Executes the command of a key during playback.
void obey(char key, host::WallPace& pace, host::Application& application) {
  switch (key) {
    case ' ':
      pace.set_paused(!pace.is_paused());
      break;
    case '.':
    case 's':
      pace.step();
      break;
    case '+':
      pace.set_rate(std::min(pace.rate() * 2, kMaxRate));
      break;
    case '-':
      pace.set_rate(std::max(pace.rate() / 2, kMinRate));
      break;
    case 'q':
      application.request_end(host::EndReason::kRequested);
      break;
    default:
      break;
  }
}

/// "   paused", "   2 times as fast"
std::string text_of(const host::WallPace& pace) {
  if (pace.is_paused()) {
    return "   paused";
  }
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "   %g times as fast", pace.rate());
  return pace.rate() == 1.0 ? "" : text.data();
}

/// Starts the application, lets it run and stops it. Returns why it counts as failed although no
/// component failed; empty if it succeeded.
std::string carry_out(host::Application& application, const RunOptions& options,
                      EndBound& end_bound, ProgressLine& progress, ConnectedRun* others) {
  const auto limit = options.limit.empty() ? std::nullopt : parse_duration(options.limit);
  // A start that hangs must not keep a run from ending that has an end.
  const std::vector<base::Refusal> refusals =
      application.start(limit ? std::optional(*limit + kStartLimit) : std::nullopt);
  print(refusals, progress);
  if (options.is_strict && !refusals.empty()) {
    end_bound.begin_within({});
    application.stop();
    return "refused by the machine";
  }
  if (others != nullptr) {
    others->report_started();
  } else {
    report_started();
  }
  progress.start(application);
  application.run(limit);
  if (others != nullptr) {
    others->report_ended(application.end_reason());
  } else {
    report_stopping();
  }
  end_bound.begin_within({});
  application.stop();
  progress.stop();
  return {};
}

/// Prints the calls that have not returned, and exits without waiting for them: objects that their
/// threads still use are not destroyed.
[[noreturn]] void leave(const std::vector<host::StuckCall>& stuck, const char* command) {
  for (const host::StuckCall& one : stuck) {
    print_to(stderr,
             "fastcycle {}: component \"{}\" has not returned from {}; the process ends without "
             "waiting for it\n",
             command, one.component, one.call);
  }
  std::fflush(nullptr);
  TerminalModes::give_back();
  std::_Exit(kFailed);
}

std::string to_text(const nlohmann::ordered_json& json) {
  return base::printable_json(
             json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) +
         "\n";
}

}  // namespace

host::ClockOptions clock_of(const RunOptions& options) {
  return {.is_simulated = options.clock == "simulated",
          .rate = options.rate.value_or(1.0),
          .workers = options.workers.value_or(0)};
}

config::Problems without_warnings(const config::Problems& problems) {
  config::Problems errors;
  for (const config::Problem& problem : problems.all()) {
    if (!problem.warning) {
      errors.add(problem);
    }
  }
  return errors;
}

std::string put_report(const host::RunReport& report, const RunOptions& options,
                       const ReportFile& report_file) {
  const std::string obstacle = report_file.write(to_text(host::to_json(report)));
  if (!options.is_quiet) {
    print_text(stdout, host::to_table(report));
    static_cast<void>(flush_output());  // It prints its errors; the run itself has not failed.
  }
  if (!obstacle.empty()) {
    print_to(stderr, "fastcycle run: the report {} was not written: {}\n", options.report.string(),
             obstacle);
  }
  return obstacle;
}

bool has_faults(const host::RunReport& report) {
  return std::ranges::any_of(report.components, [](const host::ComponentReport& component) {
    return component.faults > 0;
  });
}

int run_application(const config::ApplicationDescription& description,
                    host::LibraryLoader& libraries, const sigset_t& signals,
                    const RunOptions& options, const ReportFile& report_file, ProcessRole* role) {
  const bool is_main = role == nullptr || role->peers().is_main();
  ProgressLine progress(!options.is_quiet && is_main);
  config::Problems problems;
  std::unique_ptr<host::Replay> replay;
  host::ComponentClasses* classes = &libraries;
  if (role != nullptr) {
    classes = &role->classes();
    replay = role->take_replay();
  } else if (!options.replay.files.empty()) {
    replay = host::prepare_replay(options.replay.describe(), description, libraries, problems);
    if (!may_start(problems, options.configuration.load.file.string())) {
      return kWrong;
    }
    problems = {};
    classes = replay.get();
  }
  host::WallPace pace(options.play_rate);
  std::optional<RunObservers> observers;
  if (is_main) {
    observers.emplace(options, description);
  }
  EndBound end_bound(description, options.command, &TerminalModes::give_back);
  host::ClockOptions clock = clock_of(options);
  if (role != nullptr && role->clock() != nullptr) {
    clock.shared.emplace(*role->clock());
  }
  host::Application application(replay != nullptr ? replay->description() : description, clock);
  application.set_library_path(options.configuration.library_path);
  if (role != nullptr) {
    application.set_peers(role->peers());
  }
  if (observers) {
    observers->add_servers(application,
                           {.pace = options.is_played ? &pace : nullptr, .replay = replay.get()},
                           role != nullptr);
  }
  if (const auto kept = options.flight_recorder.describe(description); kept && is_main) {
    application.keep_last(*kept);
  }
  std::optional<StopSignals> stop_signals;
  if (is_main) {
    stop_signals.emplace(
        signals,
        [&] {
          progress.print("stopping… (Ctrl-C again ends immediately)");
          application.request_end(host::EndReason::kRequested);
          if (role != nullptr && role->clock() == nullptr) {
            // A process that hangs keeps this one from coming to the end of a round.
            role->request_end(host::EndReason::kRequested);
          }
          end_bound.begin_within({});
        },
        [&] {
          if (!application.dump("signal")) {
            progress.print("SIGUSR1 requests a dump, but there is no flight recorder");
          }
        });
  }
  if (replay != nullptr) {
    application.replay(*replay);
  }
  std::optional<TerminalKeys> keys;
  if (options.is_played && is_main) {  // The others wait for this one.
    application.set_pace(pace);
    progress.state = [&pace] { return text_of(pace); };
  }

  const auto recording = is_main ? options.record.describe(description) : std::nullopt;
  if (recording) {
    application.record(*recording);
  }
  if (observers) {
    observers->add_trace(application);
  }
  if (!options.limit.empty()) {
    end_bound.begin_within(*parse_duration(options.limit) + kStartLimit);
  }
  host::Diagnosis diagnosis(application, ".");
  application.add(diagnosis);  // After the flight recorder, in whose file a crash is noted.
  application.build(*classes, problems, host::ConstructorFault::kFault);
  if (problems.has_errors()) {
    static_cast<void>(
        may_start(without_warnings(problems), options.configuration.load.file.string()));
    return kWrong;
  }
  // Libraries and constructors have run, and could have undone it.
  if (const auto obstacle = options.is_debuggable ? std::nullopt : host::check_protection()) {
    print_to(stderr, "fastcycle {}: {}; nothing was started\n", options.command, *obstacle);
    return kWrong;
  }
  if (recording && options.record.has_settings()) {
    config::Problems warnings;
    host::check_patterns(*recording, application.topics(), warnings);
    tool::print(warnings);
  }
  if (options.is_played && role == nullptr && TerminalModes::are_there()) {
    if (!options.is_quiet) {
      progress.print(
          "keys: space pauses, . or s executes one step, + and - change the rate, q ends");
    }
    keys.emplace([&](char key) { obey(key, pace, application); });
  }
  if (observers) {
    for (const std::string& line : observers->addresses()) {
      progress.print(line);
    }
  }
  std::unique_ptr<ConnectedRun> others;
  if (role != nullptr) {
    others = role->connect(application);
    if (others == nullptr) {
      return kDone;  // All end, and it was only about to be restarted.
    }
  }
  const auto began = std::chrono::steady_clock::now();
  const std::string failure = carry_out(application, options, end_bound, progress, others.get());
  keys.reset();
  host::RunReport report = host::make_report(application, std::chrono::steady_clock::now() - began);
  if (!failure.empty()) {
    report.end = failure;
  }
  if (observers) {
    report.tools = observers->reports();
  }
  const std::string trace_problem = observers ? observers->trace_problem() : std::string();
  std::string obstacle;
  if (others != nullptr) {
    others->pass_on(report);
  } else {
    obstacle = put_report(report, options, report_file);
  }
  if (options.is_quiet && !trace_problem.empty()) {
    print_to(stderr, "fastcycle {}: the trace is incomplete: {}\n", options.command, trace_problem);
  }
  if (!application.stuck().empty()) {
    leave(application.stuck(), options.command);
  }
  // A log or a trace that was asked for and is not there, or not whole, is a failure like a missing
  // report.
  const bool has_failed =
      host::is_failure(application.end_reason()) ||
      (application.recorder() != nullptr && application.recorder()->has_failed()) ||
      !trace_problem.empty() || (options.fails_on_fault && has_faults(report));
  return has_failed || !failure.empty() || !obstacle.empty() ? kFailed : kDone;
}

}  // namespace fastcycle::tool

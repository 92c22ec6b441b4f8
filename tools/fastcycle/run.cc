#include "run.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "base/clock.h"
#include "base/log_level.h"
#include "base/printable.h"
#include "command.h"
#include "duration.h"
#include "end_bound.h"
#include "fastcycle/version.h"
#include "following.h"
#include "host/application_wiring.h"
#include "host/diagnosis.h"
#include "host/pace.h"
#include "host/prepare_replay.h"
#include "host/recording.h"
#include "loading/component_library.h"
#include "loading/protection.h"
#include "option_values.h"
#include "print.h"
#include "processes/partition.h"
#include "processes/process_plan.h"
#include "processes/supervisor.h"
#include "progress_line.h"
#include "report/report.h"
#include "report/report_parts.h"
#include "report_file.h"
#include "run_observers.h"
#include "sandbox/refusals.h"
#include "sandbox/sandbox.h"
#include "service_manager.h"
#include "stop_signals.h"
#include "terminal_keys.h"
#include "terminal_modes.h"

namespace fastcycle::tool {

std::vector<std::filesystem::path> inputs_of(const RunOptions& options) {
  std::vector<std::filesystem::path> inputs = options.configuration.load.overlays;
  inputs.push_back(options.configuration.load.file);
  inputs.insert(inputs.end(), options.replay.files.begin(), options.replay.files.end());
  return inputs;
}

namespace {

constexpr std::chrono::seconds kStartLimit{10};  ///< For all starts, in addition to --for.

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

/// The files that are read, none of which may be written.
host::ClockOptions clock_of(const RunOptions& options) {
  return {.is_simulated = options.clock == "simulated",
          .rate = options.rate.value_or(1.0),
          .workers = options.workers.value_or(0)};
}

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

/// The differences for one process of an application with several.
struct ProcessRole {
  processes::Partition& partition;
  processes::Channel& channel;
  const base::Clock* clock;  ///< Of all processes; null in simulated time.
  int report;                ///< A file for the report at the end.
  /// The replay, the same in all processes; null if there is none.
  std::unique_ptr<host::Replay> replay;
};

/// Puts this process into the sandbox that the file asks for. Returns why it cannot be.
std::optional<base::Refusal> restrict(const config::ProcessDescription& process) {
  if (process.sandbox == config::Sandbox::kNone) {
    return std::nullopt;
  }
  return sandbox::apply_sandbox({.read = process.readable,
                                 .write = process.writable,
                                 .who = &host::component_of_this_thread});
}

/// Says what the sandbox of this process refused.
void print_refusals(const std::string& process,
                    const std::vector<config::ComponentDescription>& components,
                    const char* command) {
  for (const sandbox::RefusedCall& refused : sandbox::take_refusals()) {
    const std::string to = refused.component == 0 || refused.component > components.size()
                               ? ""
                               : " to component \"" + components[refused.component - 1].name + "\"";
    print_to(stderr, "fastcycle {}: process \"{}\": its sandbox refused {}{} ({} {})\n", command,
             process, refused.call, to, refused.count, refused.count == 1 ? "time" : "times");
  }
}

/// Waits, before the start, until all processes are connected; false if there is no start.
bool wait_for_others(const ProcessRole& role, const host::Application& application) {
  using processes::Word;
  role.partition.on_sources_finished = [&role] { role.channel.send(Word::kSourcesOver); };
  role.partition.on_switch = [&role](const std::string& process) {
    role.channel.send(Word::kSwitch, process);
  };
  const bool has_sources = std::ranges::any_of(
      application.components(), [](const auto& component) { return component->is_source.load(); });
  role.channel.send(Word::kBuilt, has_sources ? processes::kHasSources : "");
  for (auto message = role.channel.receive(); message; message = role.channel.receive()) {
    if (message->word == Word::kConnect) {
      role.partition.attach();
      role.channel.send(Word::kConnected);
    } else {
      return message->word == Word::kRun;
    }
  }
  return false;
}

/// Ends the run here when it ends elsewhere, for as long as this lives. Its thread stays behind: it
/// waits for what may never come.
class EndListener {
 public:
  EndListener(const ProcessRole& role, host::Application& application)
      : shared_(std::make_shared<Shared>()) {
    shared_->application = &application;
    std::thread([&channel = role.channel, shared = shared_] {
      while (const auto message = channel.receive()) {
        const std::lock_guard lock(shared->mutex);
        if (message->word == processes::Word::kEnd && shared->application != nullptr) {
          shared->application->request_end(host::end_reason_of(message->text));
        }
      }
    }).detach();
  }
  EndListener(const EndListener&) = delete;
  EndListener& operator=(const EndListener&) = delete;
  ~EndListener() {
    const std::lock_guard lock(shared_->mutex);
    shared_->application = nullptr;
  }

 private:
  struct Shared {
    std::mutex mutex;
    host::Application* application = nullptr;
  };

  const std::shared_ptr<Shared> shared_;
};

/// Of this process alone.
host::ProcessReport report_process(const ProcessRole& role, const processes::ProcessPlan& plan,
                                   const host::RunReport& run) {
  host::ProcessReport report;
  report.name = plan.name(role.partition.process());
  report.cpu_s = run.cpu_s;
  report.rss_max_kib = run.rss_max_kib;
  for (const processes::Partition::Outlet& outlet : role.partition.outlets()) {
    const segment::ExportCounts counts = outlet.to->counts();
    const char* const always = outlet.to->always_copied();
    report.links.push_back({.topic = outlet.topic,
                            .to = plan.name(outlet.to->link().to),
                            .given = counts.given,
                            .copied = counts.copied,
                            .repaired = counts.repaired,
                            .unshared = counts.unshared,
                            .overflowed = counts.overflowed,
                            .over_quota = counts.over_quota,
                            .taken_back = counts.taken_back,
                            .always_copied = always == nullptr ? "" : always});
  }
  return report;
}

/// Starts the application, lets it run and stops it. Returns why it counts as failed although no
/// component failed; empty if it succeeded.
std::string carry_out(host::Application& application, const RunOptions& options,
                      EndBound& end_bound, ProgressLine& progress, const ProcessRole* role) {
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
  if (role != nullptr) {
    role->channel.send(processes::Word::kStarted);
  } else {
    report_started();
  }
  progress.start(application);
  application.run(limit);
  if (role != nullptr) {
    role->channel.send(processes::Word::kEnd, host::to_word(application.end_reason()));
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

std::ptrdiff_t threads_of_this_process() {
  std::error_code error;
  return std::distance(std::filesystem::directory_iterator("/proc/self/task", error),
                       std::filesystem::directory_iterator());
}

void write_whole(int file, const std::string& bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t count = write(file, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno != EINTR) {
      return;
    }
    done += count > 0 ? static_cast<std::size_t>(count) : 0;
  }
}

std::string to_text(const nlohmann::ordered_json& json) {
  return base::printable_json(
             json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) +
         "\n";
}

/// The trial has reported the warnings.
config::Problems without_warnings(const config::Problems& problems) {
  config::Problems errors;
  for (const config::Problem& problem : problems.all()) {
    if (!problem.warning) {
      errors.add(problem);
    }
  }
  return errors;
}

/// The report for people and for programs, where they are wanted; why the latter was not written.
std::string put_report(const nlohmann::ordered_json& json, const std::string& table,
                       const RunOptions& options, const ReportFile& report_file) {
  const std::string obstacle = report_file.write(to_text(json));
  if (!options.is_quiet) {
    print_text(stdout, table);
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

/// Builds and runs what was found to be right; with a `role` as one process of several.
int run_application(const config::ApplicationDescription& description,
                    host::LibraryLoader& libraries, const sigset_t& signals,
                    const RunOptions& options, const ReportFile& report_file,
                    const processes::ProcessPlan* plan = nullptr, ProcessRole* role = nullptr) {
  const bool is_main = role == nullptr || role->partition.is_main();
  ProgressLine progress(!options.is_quiet && is_main);
  config::Problems problems;
  std::unique_ptr<host::Replay> replay;
  host::ComponentClasses* classes = &libraries;
  if (role != nullptr) {
    classes = &role->partition;
  }
  if (role != nullptr) {
    replay = std::move(role->replay);
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
  if (role != nullptr && role->clock != nullptr) {
    clock.shared.emplace(*role->clock);
  }
  host::Application application(replay != nullptr ? replay->description() : description, clock);
  application.set_library_path(options.configuration.library_path);
  if (role != nullptr) {
    application.set_peers(role->partition);
  }
  if (observers) {
    observers->add_servers(application,
                           {.pace = options.is_played ? &pace : nullptr, .replay = replay.get()},
                           plan != nullptr);
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
          if (role != nullptr && role->clock == nullptr) {
            // A process that hangs keeps this one from coming to the end of a round.
            role->channel.send(processes::Word::kEnd, host::to_word(host::EndReason::kRequested));
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
  std::optional<EndListener> end_listener;
  std::optional<Following> following;
  if (role != nullptr) {
    if (plan->other_of(role->partition.process())) {
      following.emplace(*plan, role->partition, application, options.command);
      role->partition.on_standby = following->listener();
    }
    role->partition.connect(application);
    if (!wait_for_others(*role, application)) {
      return kDone;  // All end, and it was only about to be restarted.
    }
    end_listener.emplace(*role, application);
    if (following) {
      following->begin();
    }
  }
  const auto began = std::chrono::steady_clock::now();
  const std::string failure = carry_out(application, options, end_bound, progress, role);
  keys.reset();
  if (following) {
    following->end();
  }
  host::RunReport report = host::make_report(application, std::chrono::steady_clock::now() - began);
  if (!failure.empty()) {
    report.end = failure;
  }
  if (following) {
    report.tools = following->report();
  }
  if (observers) {
    const std::vector<host::ToolReport> results = observers->reports();
    report.tools.insert(report.tools.end(), results.begin(), results.end());
  }
  const std::string trace_problem = observers ? observers->trace_problem() : std::string();
  std::string obstacle;
  if (role != nullptr) {
    report.processes.push_back(report_process(*role, *plan, report));
    write_whole(role->report, host::to_bytes(report));
    print_refusals(plan->name(role->partition.process()), application.description().components,
                   options.command);
  } else {
    obstacle = put_report(host::to_json(report), host::to_table(report), options, report_file);
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

/// The replay in one process of several: its topics are connected as in `wiring`, without
/// constructing components.
std::unique_ptr<host::Replay> prepare_replay(const RunOptions& options,
                                             const config::ApplicationDescription& description,
                                             host::LibraryLoader& libraries,
                                             const host::ApplicationWiring& wiring,
                                             config::Problems& problems) {
  const auto connections = [&](const auto&, auto&, auto&) {
    std::vector<host::Connection> found;
    for (const auto& publisher : wiring.publishers) {
      found.push_back({.component = publisher.component,
                       .topic = publisher.topic,
                       .type = publisher.type,
                       .is_publisher = true});
    }
    for (const auto& subscription : wiring.subscriptions) {
      found.push_back({.component = subscription.component,
                       .topic = subscription.topic,
                       .type = subscription.type,
                       .is_publisher = false});
    }
    return found;
  };
  return host::Replay::prepare(options.replay.describe(), description, libraries, connections,
                               problems);
}

/// Without the ends of those in whose place a recording is published: it is in each process.
host::ApplicationWiring wiring_of_running(host::ApplicationWiring wiring,
                                          const host::ReplayPlan& replay) {
  const auto is_replaced = [&](const auto& end) { return !replay.runs(end.component); };
  std::erase_if(wiring.publishers, is_replaced);
  std::erase_if(wiring.subscriptions, is_replaced);
  return wiring;
}

/// @pre It is there: the file was checked.
const config::ComponentDescription& component_named(
    const config::ApplicationDescription& description, const std::string& name) {
  return *std::ranges::find(description.components, name, &config::ComponentDescription::name);
}

/// Runs an application whose components are in several processes: this one makes the others.
int run_processes(const config::ApplicationDescription& description, const host::TrialResult& tried,
                  host::LibraryLoader& libraries, const sigset_t& signals,
                  const RunOptions& options, const ReportFile& report_file) {
  const auto print_problem = [&](const std::string& sentence) {
    print_to(stderr, "fastcycle {}: {}\n", options.command, sentence);
  };
  const auto record = options.record.describe(description);
  const bool has_flight_recorder = options.flight_recorder.describe(description).has_value();
  const bool is_traced = options.trace.describe(description).has_value();
  const bool main_gets_all = options.inspect.is_wanted(description) ||
                             options.live.describe(description) || record || has_flight_recorder ||
                             is_traced;
  const bool is_simulated = clock_of(options).is_simulated;
  // Where the types of all messages are known before the first process is made, each finds them at
  // the same addresses.
  config::Problems problems;
  for (const config::ComponentDescription& component : description.components) {
    static_cast<void>(libraries.find(component, problems));
  }
  for (const config::ShadowDescription& shadow : description.shadows) {
    static_cast<void>(libraries.find(
        processes::described_as_shadow(component_named(description, shadow.of), shadow), problems));
  }
  if (!may_start(without_warnings(problems), options.configuration.load.file.string())) {
    return kWrong;
  }
  const host::ApplicationWiring wiring = host::wiring_from_text(tried.wiring);
  host::ApplicationWiring links = wiring;
  config::ApplicationDescription run_description = description;
  if (!options.replay.files.empty()) {
    // Each process reads the recording itself. This only checks it for problems.
    config::Problems of_replay;
    const auto replay = prepare_replay(options, description, libraries, wiring, of_replay);
    if (!may_start(of_replay, options.configuration.load.file.string()) || replay == nullptr) {
      return kWrong;
    }
    links = wiring_of_running(std::move(links), replay->plan());
    run_description = replay->description();
  }
  const processes::ProcessPlan plan(
      run_description, std::move(links),
      {.main_gets_all = main_gets_all,
       .has_activity = (record && record->has_activations) || has_flight_recorder || is_traced,
       .is_simulated = is_simulated,
       .simulated_workers = host::simulated_worker_count(options.workers.value_or(0))});
  if (plan.problem()) {
    print_problem(*plan.problem());
    return kWrong;
  }
  if (std::string_view(FASTCYCLE_SANITIZER) == "none" && threads_of_this_process() > 1) {
    print_problem(
        "a component library starts a thread when it is loaded, and a process with threads cannot "
        "fork; start the thread in the component's start()");
    return kWrong;
  }
  segment::Segments segments;
  if (const auto refused = segments.reserve(
          {.processes = plan.count(), .control_bytes = plan.wire().control_bytes})) {
    print_problem(*refused);
    return kFailed;
  }
  const base::Clock clock = base::Clock::live(options.rate.value_or(1.0));
  const auto work = [&](segment::ProcessIndex process, std::uint32_t incarnation,
                        processes::Channel channel, int report) -> int {
    std::unique_ptr<host::Replay> replay;
    if (!options.replay.files.empty()) {  // Before a sandbox, which may not let it be read.
      config::Problems ignored;
      replay = prepare_replay(options, plan.description_in(process), libraries, wiring, ignored);
      if (replay == nullptr) {
        return kWrong;  // It has changed since it was checked.
      }
    }
    host::ComponentClasses& classes =
        replay != nullptr ? static_cast<host::ComponentClasses&>(*replay) : libraries;
    processes::Partition partition(plan, segments, classes);
    if (const auto refused = partition.become(process, incarnation)) {
      print_problem(*refused);
      return kFailed;
    }
    // The libraries are loaded, no component was made, and there is one thread.
    if (const auto refused = restrict(plan.description_of(process))) {
      print_problem(fmt::format("process \"{}\" cannot be sandboxed: {}; {}", plan.name(process),
                                refused->what, refused->remedy));
      return kWrong;
    }
    // Its threads may still be at work when this returns: it stays as it is.
    ProcessRole role{.partition = partition,
                     .channel = channel,
                     .clock = is_simulated ? nullptr : &clock,
                     .report = report,
                     .replay = std::move(replay)};
    const int code = run_application(plan.description_in(process), libraries, signals, options,
                                     report_file, &plan, &role);
    std::fflush(nullptr);
    std::_Exit(code);
  };
  processes::Supervisor supervisor(plan, segments, work, print_problem,
                                   {.on_started = report_started, .on_ending = report_stopping});
  const auto began = std::chrono::steady_clock::now();
  const processes::Supervisor::Result result = supervisor.run();
  std::vector<host::RunReport> parts;
  for (segment::ProcessIndex process = processes::ProcessPlan::kMain; process < plan.count();
       ++process) {
    if (!result.reports[process].empty()) {
      parts.push_back(host::report_from_bytes(result.reports[process]));
      for (host::ProcessReport& one : parts.back().processes) {
        one.restarts = result.restarts[process];
      }
    }
  }
  if (parts.empty()) {
    return result.exit_code;
  }
  host::RunReport report = host::put_together(std::move(parts), description);
  for (segment::ProcessIndex process = processes::ProcessPlan::kMain; process < plan.count();
       ++process) {
    if (result.reports[process].empty() && !plan.follows_at_start(process)) {
      report.processes.push_back({.name = plan.name(process),
                                  .restarts = result.restarts[process],
                                  .has_reported = false});
    }
  }
  report.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  if (!result.end.empty()) {
    report.end = result.end;
  }
  const std::string obstacle =
      put_report(host::to_json(report), host::to_table(report), options, report_file);
  return obstacle.empty() && !(options.fails_on_fault && has_faults(report))
             ? result.exit_code
             : std::max<int>(result.exit_code, kFailed);
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

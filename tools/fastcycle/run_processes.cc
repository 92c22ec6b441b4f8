#include "run_processes.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "base/clock.h"
#include "command.h"
#include "following.h"
#include "host/application_wiring.h"
#include "host/diagnosis.h"
#include "host/recording.h"
#include "print.h"
#include "processes/partition.h"
#include "processes/process_plan.h"
#include "processes/supervisor.h"
#include "replay/replay.h"
#include "report/report_parts.h"
#include "run_application.h"
#include "sandbox/refusals.h"
#include "sandbox/sandbox.h"
#include "service_manager.h"

namespace fastcycle::tool {

namespace {

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

/// Ends the run here when it ends elsewhere, for as long as this lives. Its thread stays behind: it
/// waits for what may never come.
class EndListener {
 public:
  EndListener(const processes::Channel& channel, host::Application& application)
      : shared_(std::make_shared<Shared>()) {
    shared_->application = &application;
    std::thread([&channel, shared = shared_] {
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
host::ProcessReport report_process(const processes::Partition& partition,
                                   const processes::ProcessPlan& plan, const host::RunReport& run) {
  host::ProcessReport report;
  report.name = plan.name(partition.process());
  report.cpu_s = run.cpu_s;
  report.rss_max_kib = run.rss_max_kib;
  for (const processes::Partition::Outlet& outlet : partition.outlets()) {
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

/// An application that is connected to the other processes.
class Connected final : public ConnectedRun {
 public:
  /// `following` is null in a process that follows none; `report` is a file.
  Connected(const processes::ProcessPlan& plan, processes::Partition& partition,
            const processes::Channel& channel, host::Application& application,
            std::unique_ptr<Following> following, int report, const char* command)
      : plan_(plan),
        partition_(partition),
        channel_(channel),
        application_(application),
        report_(report),
        command_(command),
        listener_(channel, application),
        following_(std::move(following)) {
    if (following_ != nullptr) {
      following_->begin();
    }
  }

  void report_started() override { channel_.send(processes::Word::kStarted); }

  void report_ended(host::EndReason reason) override {
    channel_.send(processes::Word::kEnd, host::to_word(reason));
  }

  void pass_on(host::RunReport report) override {
    if (following_ != nullptr) {
      following_->end();
      const std::vector<host::ToolReport> differences = following_->report();
      report.tools.insert(report.tools.begin(), differences.begin(), differences.end());
    }
    report.processes.push_back(report_process(partition_, plan_, report));
    write_whole(report_, host::to_bytes(report));
    print_refusals(plan_.name(partition_.process()), application_.description().components,
                   command_);
  }

 private:
  const processes::ProcessPlan& plan_;
  processes::Partition& partition_;
  const processes::Channel& channel_;
  host::Application& application_;
  const int report_;
  const char* const command_;
  EndListener listener_;
  const std::unique_ptr<Following> following_;
};

/// One process of the application.
class Role final : public ProcessRole {
 public:
  /// All references must outlive this. `clock` is null in simulated time; `report` is a file for
  /// the report at the end.
  Role(const processes::ProcessPlan& plan, processes::Partition& partition,
       const processes::Channel& channel, const base::Clock* clock,
       std::unique_ptr<host::Replay> replay, int report, const char* command)
      : plan_(plan),
        partition_(partition),
        channel_(channel),
        clock_(clock),
        replay_(std::move(replay)),
        report_(report),
        command_(command) {}

  [[nodiscard]] host::Peers& peers() override { return partition_; }
  [[nodiscard]] host::ComponentClasses& classes() override { return partition_; }
  [[nodiscard]] const base::Clock* clock() const override { return clock_; }
  [[nodiscard]] std::unique_ptr<host::Replay> take_replay() override { return std::move(replay_); }

  void request_end(host::EndReason reason) override {
    channel_.send(processes::Word::kEnd, host::to_word(reason));
  }

  [[nodiscard]] std::unique_ptr<ConnectedRun> connect(host::Application& application) override {
    std::unique_ptr<Following> following;
    if (plan_.other_of(partition_.process())) {
      following = std::make_unique<Following>(plan_, partition_, application, command_);
      partition_.on_standby = following->listener();
    }
    partition_.connect(application);
    if (!wait_for_others(application)) {
      return nullptr;
    }
    return std::make_unique<Connected>(plan_, partition_, channel_, application,
                                       std::move(following), report_, command_);
  }

 private:
  /// False if there is no start.
  [[nodiscard]] bool wait_for_others(const host::Application& application) {
    using processes::Word;
    partition_.on_sources_finished = [this] { channel_.send(Word::kSourcesOver); };
    partition_.on_switch = [this](const std::string& process) {
      channel_.send(Word::kSwitch, process);
    };
    const bool has_sources =
        std::ranges::any_of(application.components(),
                            [](const auto& component) { return component->is_source.load(); });
    channel_.send(Word::kBuilt, has_sources ? processes::kHasSources : "");
    for (auto message = channel_.receive(); message; message = channel_.receive()) {
      if (message->word == Word::kConnect) {
        partition_.attach();
        channel_.send(Word::kConnected);
      } else {
        return message->word == Word::kRun;
      }
    }
    return false;
  }

  const processes::ProcessPlan& plan_;
  processes::Partition& partition_;
  const processes::Channel& channel_;
  const base::Clock* const clock_;
  std::unique_ptr<host::Replay> replay_;
  const int report_;
  const char* const command_;
};

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

}  // namespace

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
    Role role(plan, partition, channel, is_simulated ? nullptr : &clock, std::move(replay), report,
              options.command);
    const int code = run_application(plan.description_in(process), libraries, signals, options,
                                     report_file, &role);
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
  const std::string obstacle = put_report(report, options, report_file);
  return obstacle.empty() && !(options.fails_on_fault && has_faults(report))
             ? result.exit_code
             : std::max<int>(result.exit_code, kFailed);
}

}  // namespace fastcycle::tool

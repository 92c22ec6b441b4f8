#include "processes/supervisor.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstring>
#include <limits>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <grp.h>
#include <poll.h>
#include <pwd.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/child.h"
#include "base/clock.h"

namespace fastcycle::processes {

using segment::ProcessIndex;

namespace {

constexpr int kFailed = 1;
constexpr int kWrong = 2;        // Exit codes of `fastcycle run`.
constexpr int kSignalled = 128;  // And the signal.
constexpr int kEndedAtOnce = 130;
/// Time for a process to end on request. The steps of its end take up to 5 s.
constexpr std::chrono::seconds kEndLimit{15};
/// A restart that waits this long for memory held by others is reported.
constexpr std::int64_t kLongHeldNs = 1'000'000'000;

// Names of `EndReason`s.
constexpr const char* kInputFinished = "input finished";
constexpr const char* kComponentFault = "component fault";

std::string describe_end(int status) {
  if (WIFSIGNALED(status)) {
    return fmt::format("ended by signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
  }
  return fmt::format("ended with exit code {}", WEXITSTATUS(status));
}

/// Process name for `ps`: long names are shortened, but keep what distinguishes a standby.
std::string short_name(const std::string& name) {
  constexpr std::size_t kMost = 15;
  const std::string suffix = ProcessPlan::kStandbySuffix;
  return name.size() > kMost && name.ends_with(suffix)
             ? name.substr(0, kMost - suffix.size()) + suffix
             : name;
}

std::string read_all(int file) {
  std::string text;
  std::array<char, 65536> buffer;
  lseek(file, 0, SEEK_SET);
  for (ssize_t count = 1; count > 0;) {
    count = read(file, buffer.data(), buffer.size());
    text.append(buffer.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
  }
  return text;
}

/// Applies the CPUs, memory limit and user of the file to this process. Returns what failed.
std::string apply(const config::ProcessDescription& process) {
  if (!process.cpus.empty()) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    for (const int cpu : process.cpus) {
      CPU_SET(static_cast<std::size_t>(cpu), &cpus);
    }
    if (sched_setaffinity(0, sizeof(cpus), &cpus) != 0) {
      return fmt::format("its cpus: {}", std::strerror(errno));
    }
  }
  if (process.memory_bytes > 0) {
    // Private memory; segments of all processes are mapped, and not counted.
    const rlimit limit{.rlim_cur = process.memory_bytes, .rlim_max = process.memory_bytes};
    if (setrlimit(RLIMIT_DATA, &limit) != 0) {
      return fmt::format("its memory limit: {}", std::strerror(errno));
    }
  }
  if (!process.user.empty()) {
    const passwd* const user = getpwnam(process.user.c_str());
    if (user == nullptr || initgroups(user->pw_name, user->pw_gid) != 0 ||
        setgid(user->pw_gid) != 0 || setuid(user->pw_uid) != 0) {
      return fmt::format("its user \"{}\": {}", process.user,
                         user == nullptr ? "there is none" : std::strerror(errno));
    }
  }
  return {};
}

}  // namespace

Supervisor::Supervisor(const ProcessPlan& plan, segment::Segments& segments, Work work,
                       Report report, Milestones milestones)
    : plan_(plan),
      wire_(segments, plan.wire()),
      work_(std::move(work)),
      report_(std::move(report)),
      milestones_(std::move(milestones)),
      its_(plan.count()) {
  result_.reports.resize(plan.count());
  result_.restarts.resize(plan.count());
}

Supervisor::~Supervisor() {
  for (const Its& its : its_) {
    for (const int file : {its.end, its.report}) {
      if (file >= 0) {
        close(file);
      }
    }
  }
  if (signals_ >= 0) {
    close(signals_);
  }
}

bool Supervisor::fork_one(ProcessIndex process) {
  Its& its = its_[process];
  auto channels = Channel::make();
  const int report = memfd_create("fastcycle-report", MFD_CLOEXEC);
  if (!channels || report < 0) {
    report_(fmt::format("process \"{}\" cannot be made: {}", plan_.name(process),
                        std::strerror(errno)));
    return false;
  }
  if (its.report >= 0) {
    close(its.report);
  }
  its.report = report;
  ++its.incarnation;
  its.is_built = its.is_connected = its.is_running = its.has_started = false;
  its.silence_ns = 0;
  if (const auto other = plan_.other_of(process)) {
    const bool follows = plan_.shadow_in(process) != nullptr ||
                         (is_started_ ? may_be_followed(*other) : plan_.follows_at_start(process));
    its.is_active = !follows;
    if (is_started_ && !follows) {
      report_(
          fmt::format("process \"{}\" begins without the state of before: process \"{}\" was not "
                      "there to follow",
                      plan_.name(process), plan_.name(*other)));
    }
    wire_.begins_on_standby(process).store(std::max(1U, its_[*other].incarnation) |
                                           (follows ? segment::kFollows : 0));
  }
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid < 0) {
    report_(fmt::format("process \"{}\" cannot be made: {}", plan_.name(process),
                        std::strerror(errno)));
    return false;
  }
  if (pid == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) {
      _exit(kFailed);
    }
    channels->first.close();
    work_in_child(process, std::move(channels->second));
  }
  its.pid = pid;
  its.end = base::open_child(pid);
  its.channel = std::move(channels->first);
  return true;
}

/// Whether it is, or can become, the active process of its pair.
bool Supervisor::may_be_followed(ProcessIndex process) const {
  const segment::StandbyWords& words = wire_.standby(process, its_[process].incarnation);
  return its_[process].pid > 0 &&
         (its_[process].is_active || words.epoch.load() > 0 || words.is_in_step.load() != 0);
}

/// Whether it is a standby or a shadow, and has not taken over.
bool Supervisor::only_follows(ProcessIndex process) const {
  return plan_.other_of(process) && !its_[process].is_active &&
         wire_.standby(process, its_[process].incarnation).epoch.load() == 0;
}

void Supervisor::work_in_child(ProcessIndex process, Channel channel) {
  // Signals from a terminal go to the supervisor alone, which forwards them.
  setpgid(0, 0);
  prctl(PR_SET_NAME, short_name(plan_.name(process)).c_str());
  const int report = its_[process].report;
  const std::uint32_t incarnation = its_[process].incarnation;
  for (Its& other : its_) {
    if (other.end >= 0) {
      close(std::exchange(other.end, -1));
    }
    if (other.report >= 0 && other.report != report) {
      close(std::exchange(other.report, -1));
    }
    other.channel.close();
  }
  if (signals_ >= 0) {
    close(std::exchange(signals_, -1));
  }
  const std::string refused = apply(plan_.description_of(process));
  if (!refused.empty()) {
    report_(fmt::format("process \"{}\": {}", plan_.name(process), refused));
    _exit(kWrong);
  }
  const int code = work_(process, incarnation, std::move(channel), report);
  std::fflush(nullptr);
  _exit(code);
}

void Supervisor::announce(ProcessIndex process, std::uint32_t incarnation) {
  wire_.incarnation(process).store(incarnation, std::memory_order_seq_cst);
  wire_.changes().fetch_add(1, std::memory_order_seq_cst);
  segment::wake(wire_.changes(), INT_MAX);
}

/// A worker sent a word, or closed its end of the channel.
void Supervisor::receive(ProcessIndex process) {
  Its& its = its_[process];
  const auto message = its.channel.receive();
  if (!message) {
    its.channel.close();
    return;
  }
  switch (message->word) {
    case Word::kBuilt:
      its.is_built = true;
      its.has_sources = message->text == kHasSources;
      has_had_sources_ = has_had_sources_ || its.has_sources;
      break;
    case Word::kConnected:
      its.is_connected = true;
      break;
    case Word::kStarted:
      its.has_started = true;
      break;
    case Word::kSourcesOver:
      its.has_sources = false;
      end_if_sources_finished();
      break;
    case Word::kSwitch:
      end_for_standby(message->text);
      break;
    case Word::kEnd:
      end_all(message->text);
      break;
    case Word::kConnect:
    case Word::kRun:
      break;
  }
  proceed();
}

/// Ends a process whose standby takes over: by a kill, as in a crash, since that always works.
void Supervisor::end_for_standby(const std::string& name) {
  for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
    const auto standby = plan_.twin_of(process);
    if (plan_.name(process) == name && standby && its_[process].pid > 0 &&
        wire_.standby(*standby, its_[*standby].incarnation).is_in_step.load() != 0) {
      report_(fmt::format("process \"{}\" is ended, as it was asked for: process \"{}\" takes over",
                          name, plan_.name(*standby)));
      kill(its_[process].pid, SIGKILL);
    }
  }
}

/// Advances waiting processes to the next step once all have reached it.
void Supervisor::proceed() {
  const auto all = [this](auto member) {
    return std::ranges::all_of(its_.begin() + ProcessPlan::kMain, its_.end(),
                               [&](const Its& its) { return its.*member || its.pid < 0; });
  };
  if (!is_started_) {
    if (all(&Its::is_built) && wire_.incarnation(ProcessPlan::kMain).load() == 0) {
      for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
        announce(process, its_[process].incarnation);
      }
      for (const Its& its : its_) {
        its.channel.send(Word::kConnect);
      }
    }
    if (all(&Its::is_connected)) {
      is_started_ = true;
      for (Its& its : its_) {
        its.is_running = its.pid > 0;
        its.channel.send(Word::kRun);
      }
    }
    return;
  }
  report_if_all_started();
  for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
    Its& its = its_[process];
    if (its.pid > 0 && its.is_built && wire_.incarnation(process).load() != its.incarnation) {
      announce(process, its.incarnation);
      wire_.restarting(process).store(0, std::memory_order_seq_cst);
      its.channel.send(Word::kConnect);
    }
    if (its.pid > 0 && its.is_connected && !its.is_running) {
      its.is_running = true;
      its.channel.send(is_ending_ ? Word::kEnd : Word::kRun, "requested");
    }
  }
}

/// Processes that ended and are not restarted do not count.
void Supervisor::report_if_all_started() {
  const bool are_all = std::ranges::all_of(
      its_.begin() + ProcessPlan::kMain, its_.end(),
      [](const Its& its) { return its.has_started || (its.pid < 0 && its.restart_at_ns == 0); });
  if (is_started_ && !is_ending_ && are_all && !std::exchange(have_all_started_, true)) {
    milestones_.on_started();
  }
}

void Supervisor::take_signal() {
  signalfd_siginfo signal{};
  if (read(signals_, &signal, sizeof(signal)) != sizeof(signal)) {
    return;
  }
  const auto number = static_cast<int>(signal.ssi_signo);
  if (its_[ProcessPlan::kMain].pid > 0) {
    kill(its_[ProcessPlan::kMain].pid, number);  // At the second one it ends at once.
  }
  if (std::exchange(was_signalled_, true) && is_ending_ && kill_at_ns_ != base::kNever) {
    constexpr std::int64_t kGraceNs = 1'000'000'000;
    const std::int64_t soon_ns = base::monotonic_ns() + kGraceNs;
    kill_at_ns_ = kill_at_ns_ == 0 ? soon_ns : std::min(kill_at_ns_, soon_ns);
    interrupted_by_ = number;
  }
}

void Supervisor::end_all(const std::string& reason) {
  if (std::exchange(is_ending_, true)) {
    return;
  }
  milestones_.on_ending();
  for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
    wire_.restarting(process).store(0, std::memory_order_seq_cst);
  }
  kill_at_ns_ = base::monotonic_ns() + std::chrono::nanoseconds(kEndLimit).count();
  for (Its& its : its_) {
    its.restart_at_ns = 0;
    its.channel.send(Word::kEnd, reason);
  }
}

void Supervisor::end_if_sources_finished() {
  if (has_had_sources_ && is_started_ &&
      std::ranges::none_of(its_, [](const Its& its) { return its.has_sources; })) {
    end_all(kInputFinished);
  }
}

void Supervisor::kill_all() {
  for (const Its& its : its_) {
    if (its.pid > 0) {
      kill(its.pid, SIGKILL);
    }
  }
}

/// Records whether a process that has ended served rounds of simulated time.
void Supervisor::note_join(ProcessIndex process) {
  Its& its = its_[process];
  if (plan_.is_simulated()) {
    const segment::RoundWords& words = wire_.rounds(process, its.incarnation);
    const bool has_joined = words.count.load() != 0 && words.is_joining.load() == 0;
    its.never_joined = has_joined || its.incarnation == 1 ? 0 : its.never_joined + 1;
  }
}

/// Whether a process that has ended is restarted.
bool Supervisor::will_restart(ProcessIndex process, int status) const {
  const Its& its = its_[process];
  const config::ProcessDescription description = plan_.description_of(process);
  const bool is_asked_for = is_ending_ || (process == ProcessPlan::kMain && WIFEXITED(status) &&
                                           WEXITSTATUS(status) == kEndedAtOnce);
  // Its last facts are still read at their place, in memory that the incarnation after next reuses.
  const bool may_join = its.never_joined < segment::Segments::kGenerations - 1;
  return is_started_ && !is_asked_for && may_join &&
         description.on_exit == config::OnExit::kRestart &&
         restarts_of(its, description.restart) < description.restart.limit;
}

/// Number of restarts that count now.
std::uint32_t Supervisor::restarts_of(const Its& its,
                                      const config::RestartDescription& restart) const {
  const bool are_old = base::monotonic_ns() - its.first_restart_ns > restart.within.count();
  return are_old ? 0 : its.restarts;
}

/// Handles the end of a process.
void Supervisor::take_end(ProcessIndex process) {
  Its& its = its_[process];
  int status = 0;
  if (waitpid(its.pid, &status, WNOHANG) != its.pid) {
    return;
  }
  kill(-its.pid, SIGKILL);  // Processes it started in its group end with it.
  its.pid = -1;
  if (its.end >= 0) {
    close(std::exchange(its.end, -1));
  }
  its.channel.close();
  note_join(process);
  // Before its end is announced, so that no process continues without it.
  wire_.restarting(process).store(will_restart(process, status) ? its.incarnation + 1 : 0,
                                  std::memory_order_seq_cst);
  announce(process, 0);
  result_.reports[process] = read_all(its.report);
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : kFailed;
  if (!is_started_) {
    if (!std::exchange(is_ending_, true)) {  // The others end because of this one.
      const std::uint64_t memory = plan_.description_of(process).memory_bytes;
      const std::string limit =
          memory == 0
              ? ""
              : fmt::format("; its memory is limited to {} MB (memory_mb)", memory / 1'000'000);
      report_(fmt::format("process \"{}\" {} before the start{}", plan_.name(process),
                          describe_end(status), limit));
      result_.exit_code = code == 0 ? kFailed : code;
      kill_all();
    }
    return;
  }
  if (process == ProcessPlan::kMain && code == kEndedAtOnce) {
    result_.exit_code = kEndedAtOnce;
    is_ending_ = true;
    kill_all();
    return;
  }
  if (WIFEXITED(status) && is_ending_) {
    result_.exit_code = std::max(result_.exit_code, code);
    return;
  }
  if (is_ending_ && kill_at_ns_ == base::kNever) {
    return;  // It was killed because it did not end in time.
  }
  consider_restart(process, describe_end(status));
}

void Supervisor::go_on_without(Its& its, const std::string& what) {
  report_(what + "; the others go on without it");
  its.has_sources = false;
  end_if_sources_finished();
  report_if_all_started();
}

void Supervisor::consider_restart(ProcessIndex process, const std::string& how) {
  Its& its = its_[process];
  const config::ProcessDescription description = plan_.description_of(process);
  const std::string what = fmt::format("process \"{}\" {}", plan_.name(process), how);
  if (is_ending_) {
    report_(what);
    result_.exit_code = std::max(result_.exit_code, kFailed);
    return;
  }
  switch (description.on_exit) {
    case config::OnExit::kContinue:
      go_on_without(its, what);
      return;
    case config::OnExit::kRestart: {
      const config::RestartDescription& restart = description.restart;
      const std::int64_t now_ns = base::monotonic_ns();
      if (wire_.restarting(process).load() != 0) {
        its.restarts = restarts_of(its, restart);
        if (its.restarts == 0) {
          its.first_restart_ns = now_ns;
        }
        std::chrono::nanoseconds delay = std::min(restart.back_off, restart.back_off_max);
        for (std::uint32_t i = 0; i < its.restarts && delay < restart.back_off_max; ++i) {
          delay = std::min(2 * delay, restart.back_off_max);
        }
        ++its.restarts;
        its.restart_at_ns = std::max<std::int64_t>(1, now_ns + delay.count());
        report_(what + "; it is restarted");
        restart_due();
        return;
      }
      if (restart.then == config::AfterRestarts::kContinue || only_follows(process)) {
        go_on_without(its, fmt::format("{}, after {} restarts", what, its.restarts));
        return;
      }
      report_(
          its.never_joined > 0
              ? fmt::format("{}, {} times before it had come to the time of the others; the "
                            "application stops",
                            what, its.never_joined)
              : fmt::format("{}, after {} restarts; the application stops", what, its.restarts));
      break;
    }
    case config::OnExit::kStop:
      report_(what + "; the application stops");
      break;
  }
  result_.end = what;
  result_.exit_code = kFailed;
  end_all(kComponentFault);
}

/// The process that still holds a message of the incarnation whose memory this one reuses; none if
/// there is none.
std::optional<ProcessIndex> Supervisor::holder_of_generation(ProcessIndex process,
                                                             std::uint32_t incarnation) const {
  if (incarnation <= segment::Segments::kGenerations) {
    return {};
  }
  const std::uint32_t before = incarnation - segment::Segments::kGenerations;
  for (const segment::LinkPlan& link : plan_.wire().links) {
    const std::uint32_t receiver = wire_.incarnation(link.to).load();
    if (link.from != process || receiver == 0) {
      continue;
    }
    const std::uint32_t oldest = wire_.in(link, receiver).oldest.load(std::memory_order_acquire);
    if (oldest != 0 && oldest <= before) {
      return link.to;
    }
  }
  return {};
}

void Supervisor::restart_due() {
  const std::int64_t now_ns = base::monotonic_ns();
  for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
    Its& its = its_[process];
    if (its.restart_at_ns == 0 || its.restart_at_ns > now_ns) {
      continue;
    }
    if (const auto holder = holder_of_generation(process, its.incarnation + 1)) {
      announce(process, 0);  // Has them check what they hold.
      if (now_ns - its.restart_at_ns > kLongHeldNs && !std::exchange(its.is_wait_reported, true)) {
        report_(
            fmt::format("process \"{}\" is not restarted yet: process \"{}\" still keeps a message "
                        "of its run {}",
                        plan_.name(process), plan_.name(*holder),
                        its.incarnation + 1 - segment::Segments::kGenerations));
        if (plan_.is_simulated()) {  // Simulated time stands still until it is back.
          report_("the application stops, since simulated time does not go on meanwhile");
          result_.exit_code = kFailed;
          end_all(kComponentFault);
          return;
        }
      }
    } else {
      its.restart_at_ns = 0;
      its.is_wait_reported = false;
      ++result_.restarts[process];
      if (!fork_one(process)) {
        its.restart_at_ns = now_ns + 100'000'000;  // The kernel may have room again.
      }
    }
  }
}

/// Kills processes without a heartbeat for longer than their limit. Only supervised time counts:
/// the whole machine may have been suspended.
void Supervisor::look_at_heartbeats() {
  constexpr std::int64_t kMostNs = 20'000'000;
  const std::int64_t now_ns = base::monotonic_ns();
  const std::int64_t passed_ns = std::min(now_ns - looked_ns_, kMostNs);
  looked_ns_ = now_ns;
  if (is_ending_) {
    return;  // Ending processes stop their heartbeats; `kill_at_ns_` limits their end.
  }
  for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
    Its& its = its_[process];
    const std::int64_t limit_ns = plan_.description_of(process).heartbeat.count();
    if (limit_ns == 0 || its.pid < 0 || !its.is_running) {
      continue;
    }
    const std::uint32_t now = wire_.stage(process, its.incarnation, plan_.heartbeat_word()).load();
    its.silence_ns = now == its.heartbeat ? its.silence_ns + passed_ns : 0;
    its.heartbeat = now;
    if (its.silence_ns > limit_ns) {
      report_(fmt::format("process \"{}\" has given no sign of life for {} ms; it is ended",
                          plan_.name(process), limit_ns / 1'000'000));
      its.silence_ns = std::numeric_limits<std::int32_t>::min();  // Once.
      kill(its.pid, SIGKILL);
    }
  }
}

bool Supervisor::is_anyone_left() const {
  return std::ranges::any_of(its_, [this](const Its& its) {
    return its.pid > 0 || (its.restart_at_ns != 0 && !is_ending_);
  });
}

Supervisor::Result Supervisor::run() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) {
    sigaddset(&signals, signal);
  }
  struct sigaction hang_up{};
  if (sigaction(SIGHUP, nullptr, &hang_up) == 0 && hang_up.sa_handler != SIG_IGN) {
    sigaddset(&signals, SIGHUP);
  }
  for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
    if (!fork_one(process)) {
      kill_all();
      result_.exit_code = kFailed;
      is_ending_ = true;
      break;
    }
  }
  signals_ = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
  const bool has_heartbeats =
      std::ranges::any_of(plan_.description().processes,
                          [](const auto& process) { return process.heartbeat.count() > 0; });
  const bool has_standbys = std::ranges::any_of(plan_.description().processes,
                                                &config::ProcessDescription::has_standby) &&
                            !plan_.is_simulated();
  while (is_anyone_left()) {
    bool has_unwatched = false;  // Processes whose end no descriptor reports.
    std::vector<pollfd> files = {{signals_, POLLIN, 0}};
    std::vector<std::pair<ProcessIndex, bool>> whose = {{0, false}};
    for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
      const Its& its = its_[process];
      if (its.pid > 0) {
        files.push_back({its.channel.socket(), POLLIN, 0});
        whose.emplace_back(process, false);
        files.push_back({its.end, POLLIN, 0});
        whose.emplace_back(process, true);
        has_unwatched = has_unwatched || its.end < 0;
      }
    }
    const bool has_due =
        kill_at_ns_ != 0 || has_heartbeats || has_unwatched ||
        std::ranges::any_of(its_, [](const Its& its) { return its.restart_at_ns != 0; });
    const int look_ms = has_standbys ? 1 : base::kLookAgainMs;
    poll(files.data(), files.size(), has_due ? look_ms : -1);
    if (files[0].revents != 0) {
      take_signal();
    }
    for (std::size_t i = 1; i < files.size(); ++i) {
      const bool may_have_ended = whose[i].second && files[i].fd < 0;
      if (files[i].revents == 0 && !may_have_ended) {
        continue;
      }
      if (whose[i].second) {
        take_end(whose[i].first);
      } else {
        receive(whose[i].first);
      }
    }
    restart_due();
    if (has_heartbeats) {
      look_at_heartbeats();
    }
    if (kill_at_ns_ != 0 && kill_at_ns_ != base::kNever && base::monotonic_ns() > kill_at_ns_) {
      kill_at_ns_ = base::kNever;
      for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
        if (its_[process].pid > 0) {
          report_(fmt::format("process \"{}\" has not come to its end; it is ended",
                              plan_.name(process)));
        }
      }
      result_.exit_code = interrupted_by_ != 0 ? kSignalled + interrupted_by_
                                               : std::max(result_.exit_code, kFailed);
      kill_all();
    }
  }
  return result_;
}

}  // namespace fastcycle::processes

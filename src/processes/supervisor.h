#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "processes/channel.h"
#include "processes/process_plan.h"
#include "segment/segments.h"
#include "segment/wire.h"

namespace fastcycle::processes {

/// Starts the processes of an application, monitors them, and restarts those that end, as the file
/// specifies. It does nothing else: it runs no component's code, and no message depends on it.
///
/// @threads  Confined to the only thread of its process.
class Supervisor {
 public:
  /// Runs a process from begin to end; returns its exit code. `report` is a file for its final
  /// report.
  using Work = std::function<int(segment::ProcessIndex process, std::uint32_t incarnation,
                                 Channel channel, int report)>;
  /// Called with messages for the user.
  using Report = std::function<void(const std::string& sentence)>;
  /// Called once each: when the components of all processes are started, and when they begin to
  /// stop.
  struct Milestones {
    std::function<void()> on_started = [] {};
    std::function<void()> on_ending = [] {};
  };

  Supervisor(const ProcessPlan& plan, segment::Segments& segments, Work work, Report report,
             Milestones milestones);
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;
  ~Supervisor();

  struct Result {
    int exit_code = 0;
    std::string end;  ///< Why the run ended, if a process caused it.
    /// By process, the report of its last incarnation; empty if it wrote none.
    std::vector<std::string> reports;
    std::vector<std::uint32_t> restarts;  ///< By process.
  };
  /// Runs the application to its end. The caller blocks the signals that end it; they are handled
  /// here.
  [[nodiscard]] Result run();

 private:
  /// One process and its present incarnation.
  struct Its {
    pid_t pid = -1;
    int end = -1;  ///< Readable when it has ended; −1 without pidfds.
    int report = -1;
    std::uint32_t incarnation = 0;
    Channel channel;
    bool is_built = false;
    bool is_connected = false;
    bool is_running = false;
    bool has_started = false;        ///< Its components.
    bool is_active = false;          ///< Of a pair: it was started as the active one.
    bool has_sources = false;        ///< Unfinished ones.
    std::int64_t restart_at_ns = 0;  ///< 0: no restart pending.
    bool is_wait_reported = false;   ///< That its restart has to wait was reported.
    std::uint32_t restarts = 0;      ///< Since `first_restart_ns`.
    std::int64_t first_restart_ns = 0;
    /// In simulated time: how many in a row ended before they reached the time of the others.
    std::uint32_t never_joined = 0;
    std::uint32_t heartbeat = 0;  ///< Last value seen.
    std::int64_t silence_ns = 0;  ///< For how long it has not changed.
  };

  bool fork_one(segment::ProcessIndex process);
  [[nodiscard]] bool may_be_followed(segment::ProcessIndex process) const;
  [[nodiscard]] bool only_follows(segment::ProcessIndex process) const;
  [[noreturn]] void work_in_child(segment::ProcessIndex process, Channel channel);
  void announce(segment::ProcessIndex process, std::uint32_t incarnation);
  void receive(segment::ProcessIndex process);
  void end_for_standby(const std::string& name);
  void proceed();
  void report_if_all_started();
  void take_signal();
  void take_end(segment::ProcessIndex process);
  void note_join(segment::ProcessIndex process);
  [[nodiscard]] bool will_restart(segment::ProcessIndex process, int status) const;
  [[nodiscard]] std::uint32_t restarts_of(const Its& its,
                                          const config::RestartDescription& restart) const;
  void go_on_without(Its& its, const std::string& what);
  void consider_restart(segment::ProcessIndex process, const std::string& how);
  [[nodiscard]] std::optional<segment::ProcessIndex> holder_of_generation(
      segment::ProcessIndex process, std::uint32_t incarnation) const;
  void restart_due();
  void look_at_heartbeats();
  void end_if_sources_finished();
  void end_all(const std::string& reason);
  void kill_all();
  [[nodiscard]] bool is_anyone_left() const;

  const ProcessPlan& plan_;
  const segment::Wire wire_;
  const Work work_;
  const Report report_;
  const Milestones milestones_;
  std::vector<Its> its_;  ///< By process; the first is unused.
  int signals_ = -1;
  bool is_started_ = false;
  bool have_all_started_ = false;  ///< Their components.
  bool has_had_sources_ = false;
  bool is_ending_ = false;
  std::int64_t kill_at_ns_ = 0;  ///< 0: no deadline.
  bool was_signalled_ = false;
  int interrupted_by_ = 0;      ///< The signal that did not wait for the end.
  std::int64_t looked_ns_ = 0;  ///< When heartbeats were checked last.
  Result result_;
};

}  // namespace fastcycle::processes

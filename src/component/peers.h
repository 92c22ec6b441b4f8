#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/clock.h"
#include "component/component_core.h"
#include "executor/peer_activity.h"
#include "executor/round_peers.h"
#include "fastcycle/time.h"

namespace fastcycle::host {

/// A message about the application as a whole, such as a switch of modes: sent by one process, and
/// received by all, itself included, in the same order.
struct Notice {
  enum class Kind : char {
    kGone = 'g',           ///< A process has ended.
    kCame = 'c',           ///< It was restarted.
    kReads = 'r',          ///< A restarted process reads from the others.
    kModesBegun = 'b',     ///< All components have started: modes may be switched.
    kModeAsked = 'm',      ///< A mode is requested.
    kModeLeft = 'l',       ///< The components of a process have left the mode.
    kModeEntered = 'e',    ///< All have left; the new mode applies.
    kModeJoined = 'j',     ///< Those of a process that belong to it are active.
    kNews = 'n',           ///< State of a component. Live, only the main process handles it.
    kLine = 'o',           ///< A line of the log. Live, only the main process handles it.
    kDumpAsked = 't',      ///< A dump of the flight recorder. Only the main process handles it.
    kFollows = 'y',        ///< State of a standby. The main process keeps it.
    kLifeAsked = 'a',      ///< A tool requests to restart, stop or start a component.
    kLifeMade = 'f',       ///< The result of `kLifeAsked`.
    kParamsListed = 'i',   ///< The params of a component.
    kParamsAsked = 'p',    ///< A change of params is requested.
    kParamsChecked = 'v',  ///< A process's answer to it.
    kParamsDropped = 'w',  ///< The requester waits no more: it is not made.
    kParamsInPlace = 'd',  ///< Live: it is made in a process.
  };
  Kind kind{};
  std::uint32_t process = 0;  ///< The sender; of `kGone` and `kCame`, the subject.
  std::uint32_t component =
      0;  ///< The component concerned. Notices of a simulated round are in this order.
  std::string text = {};

  /// The text of `kGone` where the process is restarted.
  static constexpr const char* kRestarts = "restarts";
};

/// The other processes of an application, as seen by one of them: which components run there, and
/// their progress of start and end. Each process has an object for every component; those that run
/// elsewhere represent its publishers, and are never started.
///
/// A wait for a process that has ended returns.
///
/// @threads  Confined to the control thread; `runs_here` and `sources_finished` are Safe.
class Peers {
 public:
  Peers() = default;
  Peers(const Peers&) = delete;
  Peers& operator=(const Peers&) = delete;
  virtual ~Peers() = default;

  [[nodiscard]] virtual bool runs_here(const std::string& component) const = 0;
  /// The process of `component`, as notices name it.
  [[nodiscard]] virtual std::uint32_t process_of(const std::string& component) const = 0;
  /// How many messages may wait in each lane of a component on standby.
  [[nodiscard]] virtual std::uint16_t lane_room(const std::string& component) const = 0;
  /// Whether a component of any process subscribes to `topic`.
  [[nodiscard]] virtual bool is_wanted(const std::string& topic) const = 0;
  /// The name of this process.
  [[nodiscard]] virtual const std::string& name() const = 0;
  /// Another process of the application, or a standby.
  struct Process {
    std::string name;
    std::int64_t pid = 0;
  };
  /// The other processes that live now, as far as that is known here. Safe.
  [[nodiscard]] virtual std::vector<Process> others() const = 0;
  /// Whether this process has the tools: status, log, recorder, inspection.
  [[nodiscard]] virtual bool is_main() const = 0;
  /// The services of the whole application.
  [[nodiscard]] virtual const std::set<std::string>& services() const = 0;
  /// Declares the publishers of a component that runs elsewhere; within its constructor.
  virtual void declare(detail::ComponentCore& component) = 0;

  /// Messages that arrived here from processes that are not trusted, and were none of their topic's
  /// type: since the last call, for each publisher; one of them is reported at most every 10 s. As
  /// `on_look`, or in `on_quiet`.
  struct Invalid {
    std::string process;
    std::string component;
    std::string topic;
    std::uint64_t count = 0;
  };
  [[nodiscard]] virtual std::vector<Invalid> take_invalid() = 0;

  /// `process` reads what components here publish: gives it their latched messages.
  virtual void give_latched(std::uint32_t process) = 0;

  /// All workers have ended: counts what other processes published last, and was lost on the way.
  virtual void count_rest() = 0;

  /// All sources of this process have finished: the run ends when those of all have.
  virtual void sources_finished() = 0;

  /// Sends a notice to all processes. Safe; live, from any thread.
  ///
  /// @errors  std::length_error if `text` has more than 60,000 bytes.
  virtual void send_notice(Notice::Kind kind, std::uint32_t component, std::string text) = 0;
  /// Whether `process`, as `Notice` names it, is this one.
  [[nodiscard]] virtual bool is_here(std::uint32_t process) const = 0;
  /// The receivers of notices, this process included, as of the last `kGone` or `kCame`; in
  /// `on_notice`.
  [[nodiscard]] virtual const std::set<std::uint32_t>& recipients() const = 0;
  /// Receives notices; set before the start. Live on a thread of its own, which must not wait for
  /// components; in simulated time at the end of a round.
  std::function<void(const Notice&)> on_notice;
  /// Live: called by the same thread, periodically and after `look`. Returns when it is to be
  /// called again, on CLOCK_MONOTONIC; `base::kNever`: at the next period.
  std::function<std::int64_t()> on_look;
  /// Schedules a call of `on_look`. Safe.
  virtual void look() = 0;
  /// Makes the snapshot that a restarted process needs in place of all notices so far, and takes it
  /// there, before its start. The first is called as `on_notice`.
  std::function<std::string()> make_snapshot;
  std::function<void(const std::string&)> take_snapshot;
  /// Called as `make_snapshot` when its snapshot of so many bytes has no room: the last one stays.
  std::function<void(std::size_t bytes, std::size_t room)> on_snapshot_refused;
  /// In simulated time, at the end of a round, before its notices are handled.
  std::function<void()> on_round_ends;
  /// In simulated time, at the end of a round, before `on_notice`: whether `is_busy` returned true
  /// in any process.
  std::function<void(bool)> on_round_over;
  std::function<bool()> is_busy;
  /// The same, when no answer to a notice is pending any more.
  std::function<void()> on_quiet;

  /// Whether a process records the activity of the components of all processes.
  [[nodiscard]] virtual bool keeps_activity() const = 0;
  /// The activity rings of this process: one for each worker, and one for each of its components;
  /// null for one that is not in the application file. From the end of the build on.
  [[nodiscard]] virtual std::vector<detail::ActivationRing*> rings() const = 0;
  [[nodiscard]] virtual std::unique_ptr<detail::ReadRing> reads_of(std::size_t component) const = 0;
  /// The activity of the others.
  [[nodiscard]] virtual std::vector<const detail::PeerActivity*> activity_elsewhere() const = 0;

  /// In simulated time: synchronizes the rounds of all. Null live. From the end of the build on.
  [[nodiscard]] virtual detail::RoundPeers* rounds() = 0;
  /// How many places there are in the order of starts, in all processes alike: those of the
  /// components, and of what only one of the processes has.
  [[nodiscard]] virtual std::size_t place_count() const = 0;
  /// In simulated time: the end that all agreed on, at the same point of the run in each process.
  enum class AgreedEnd : std::uint8_t { kNone, kInputOver, kOther };
  [[nodiscard]] virtual AgreedEnd agreed_end() const = 0;

  /// The component with index `place` in the order of starts is next here.
  virtual void reach_start(std::size_t place) = 0;
  /// Waits until the component at `place`, which runs elsewhere, was called to start, or `is_over`.
  virtual void await_start(const detail::ComponentCore& component, std::size_t place,
                           const std::function<bool()>& is_over) = 0;
  /// All have started here: waits for the others, and returns when timers start everywhere. A
  /// stopped clock resumes at the same time in all processes.
  [[nodiscard]] virtual Time agree_on_begin(base::Clock& clock,
                                            const std::function<bool()>& is_over) = 0;
  /// Live: when the others' clocks began to run, in nanoseconds of CLOCK_MONOTONIC, if this process
  /// was restarted after that.
  [[nodiscard]] virtual std::optional<std::int64_t> clocks_began() const = 0;
  /// When timers started in the application's first processes; after `agree_on_begin`.
  [[nodiscard]] virtual Time began() const = 0;

  /// Live: all replayed input of this process was published. Waits for the others, or until
  /// `is_over`.
  virtual void reach_end_of_input(const std::function<bool()>& is_over) = 0;

  /// Replaces the process of `component` by its standby. Returns why that cannot be done; empty if
  /// it can. Safe.
  [[nodiscard]] virtual std::string switch_to_standby(const std::string& component) = 0;
  /// Where a crash stores the index + 1 of the component whose activation it was in; null if it
  /// need not.
  [[nodiscard]] virtual std::atomic<std::uint32_t>* crashed() = 0;
  /// The application begins to stop here.
  virtual void stops() = 0;
  /// Common steps of the end, in this order; each waits until all processes have reached it.
  enum class Step : std::uint8_t { kTimersStopped, kDrained, kDrainedAgain };
  virtual void reach(Step step) = 0;
  /// As for the starts, in the reverse order.
  virtual void reach_stop(std::size_t place) = 0;
  virtual void await_stop(const detail::ComponentCore& component, std::size_t place) = 0;
  /// All have stopped here.
  virtual void end() = 0;
  /// No notice is handled here any more; waits for the one being handled.
  virtual void stop_notices() = 0;
};

}  // namespace fastcycle::host

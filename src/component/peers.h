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

/// What concerns the application as a whole, such as a switch of modes: said by one process, and
/// taken by all, itself included, in the same order.
struct Notice {
  enum class Kind : char {
    kGone = 'g',           ///< A process has ended.
    kCame = 'c',           ///< It was restarted.
    kReads = 'r',          ///< A restarted process reads what others publish.
    kModesBegun = 'b',     ///< All components have started: modes may be switched.
    kModeAsked = 'm',      ///< Somebody asks for a mode.
    kModeLeft = 'l',       ///< The components of a process that leave the mode have left.
    kModeEntered = 'e',    ///< So have all; the mode is the new one.
    kModeJoined = 'j',     ///< Those of a process that join it are active.
    kNews = 'n',           ///< How a component is. Live, the main process alone takes it.
    kLine = 'o',           ///< A line of the log. Live, the main process alone takes it.
    kFollows = 'y',        ///< How one that follows another stands. The main process keeps it.
    kLifeAsked = 'a',      ///< A tool asks to restart, stop or start a component.
    kLifeMade = 'f',       ///< What became of it.
    kParamsListed = 'i',   ///< The params of a component.
    kParamsAsked = 'p',    ///< Somebody asks for a change of params.
    kParamsChecked = 'v',  ///< What a process says to it.
    kParamsDropped = 'w',  ///< Who asked does not wait any longer: it is not made.
    kParamsInPlace = 'd',  ///< Live: it is made in a process.
  };
  Kind kind{};
  std::uint32_t process = 0;  ///< Who says it; of `kGone` and `kCame`, who it is said of.
  std::uint32_t component =
      0;  ///< For whom it is said. Those of a simulated round come in this order.
  std::string text = {};

  /// The text of `kGone` where the process is restarted.
  static constexpr const char* kRestarts = "restarts";
};

/// The other processes of an application, as far as one of them must know them: which components
/// run there, and how far all are with start and end. In each process there is an object for every
/// component; those that run elsewhere stand for what these publish, and are never started.
///
/// Whoever waits for a process that has ended goes on.
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
  /// How many messages may wait in each lane of a component while it follows another one.
  [[nodiscard]] virtual std::uint16_t lane_room(const std::string& component) const = 0;
  /// Whether a component of any process subscribes to `topic`.
  [[nodiscard]] virtual bool is_wanted(const std::string& topic) const = 0;
  /// How this process is called.
  [[nodiscard]] virtual const std::string& name() const = 0;
  /// Whether this process has the tools: status, log, recorder, inspection.
  [[nodiscard]] virtual bool is_main() const = 0;
  /// The services of the whole application.
  [[nodiscard]] virtual const std::set<std::string>& services() const = 0;
  /// Declares the publishers of a component that runs elsewhere; within its constructor.
  virtual void declare(detail::ComponentCore& component) = 0;

  /// `process` reads what components here publish, and has what they keep for who comes late.
  virtual void give_latched(std::uint32_t process) = 0;

  /// All sources of this process have finished: the run ends when those of all have.
  virtual void sources_finished() = 0;

  /// Says this to all processes. Safe; live, from any thread.
  ///
  /// @errors  std::length_error if `text` has more than 60,000 bytes.
  virtual void tell(Notice::Kind kind, std::uint32_t component, std::string text) = 0;
  /// Whether `process`, as `Notice` names it, is this one.
  [[nodiscard]] virtual bool is_here(std::uint32_t process) const = 0;
  /// Who is told, this process included, as of the last `kGone` or `kCame`; in `on_notice`.
  [[nodiscard]] virtual const std::set<std::uint32_t>& told() const = 0;
  /// Takes what is told; set before the start. Live by a thread of its own, which must not wait for
  /// components; in simulated time when a round is over.
  std::function<void(const Notice&)> on_notice;
  /// Live: looked at by the same thread, now and then and after `look`. Returns when it is to be
  /// called again, on CLOCK_MONOTONIC; `base::kNever`: by its turn.
  std::function<std::int64_t()> on_look;
  /// Has `on_look` called soon. Safe.
  virtual void look() = 0;
  /// What a process must know that is restarted after all that was told so far; and takes it there,
  /// before its start. The first is called as `on_notice`.
  std::function<std::string()> make_snapshot;
  std::function<void(const std::string&)> take_snapshot;
  /// In simulated time, when a round is over, before what was told in it is taken.
  std::function<void()> on_round_ends;
  /// In simulated time, when a round is over, before `on_notice`: whether `is_busy` said true in
  /// any process.
  std::function<void(bool)> on_round_over;
  std::function<bool()> is_busy;
  /// The same, when there is no answer any more to what was told.
  std::function<void()> on_quiet;

  /// Whether a process records what the components of all do.
  [[nodiscard]] virtual bool keeps_activity() const = 0;
  /// Where that is kept of this process: by its workers, and by one of its components; null for one
  /// that is not in the application file. From the end of the build on.
  [[nodiscard]] virtual std::vector<detail::ActivationRing*> rings() const = 0;
  [[nodiscard]] virtual std::unique_ptr<detail::ReadRing> reads_of(std::size_t component) const = 0;
  /// Where it is kept of the others.
  [[nodiscard]] virtual std::vector<const detail::PeerActivity*> activity_elsewhere() const = 0;

  /// In simulated time: how all serve the same rounds. Null live. From the end of the build on.
  [[nodiscard]] virtual detail::RoundPeers* rounds() = 0;
  /// How many places there are in the order of starts, in all processes alike: those of the
  /// components, and of what only one of the processes has.
  [[nodiscard]] virtual std::size_t place_count() const = 0;
  /// In simulated time: what all agreed on. In each process it becomes true at the same point of
  /// the run.
  enum class AgreedEnd : std::uint8_t { kNone, kInputOver, kOther };
  [[nodiscard]] virtual AgreedEnd agreed_end() const = 0;

  /// The component that is number `place` in the order of starts comes next here.
  virtual void reach_start(std::size_t place) = 0;
  /// Waits until the component at `place`, which runs elsewhere, was called to start, or `is_over`.
  virtual void await_start(const detail::ComponentCore& component, std::size_t place,
                           const std::function<bool()>& is_over) = 0;
  /// All have started here: waits for the others, and returns when timers start everywhere. A clock
  /// that stands goes on, in all processes at the same moment.
  [[nodiscard]] virtual Time agree_on_begin(base::Clock& clock,
                                            const std::function<bool()>& is_over) = 0;
  /// Live: when the others' clocks stopped standing, in nanoseconds of CLOCK_MONOTONIC, if this is
  /// a process that was restarted after that.
  [[nodiscard]] virtual std::optional<std::int64_t> clocks_began() const = 0;
  /// When timers started in the application's first processes; after `agree_on_begin`.
  [[nodiscard]] virtual Time began() const = 0;

  /// Live: all that is replayed here has come. Waits for the others, or until `is_over`.
  virtual void reach_end_of_input(const std::function<bool()>& is_over) = 0;

  /// Has the process of `component` give its place to its standby. Returns why not; empty if it
  /// does. Safe.
  [[nodiscard]] virtual std::string switch_to_standby(const std::string& component) = 0;
  /// Where a crash says in whose activation it was, the component's place + 1; null: nobody asks.
  [[nodiscard]] virtual std::atomic<std::uint32_t>* crashed() = 0;
  /// The application begins to stop here.
  virtual void stops() = 0;
  /// What all do together at the end, in this order; each waits until all others came as far.
  enum class Step : std::uint8_t { kTimersStopped, kDrained, kDrainedAgain };
  virtual void reach(Step step) = 0;
  /// As for the starts, in the reverse order.
  virtual void reach_stop(std::size_t place) = 0;
  virtual void await_stop(const detail::ComponentCore& component, std::size_t place) = 0;
  /// All have stopped here.
  virtual void end() = 0;
  /// From now on nothing that is told is taken here; waits for what is being taken.
  virtual void stop_notices() = 0;
};

}  // namespace fastcycle::host

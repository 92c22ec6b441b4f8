#pragma once

#include <cstddef>
#include <functional>
#include <set>
#include <string>

#include "component/component_core.h"
#include "executor/round_peers.h"
#include "fastcycle/time.h"

namespace fastcycle::host {

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
  /// Whether this process has the tools: status, log, recorder, inspection.
  [[nodiscard]] virtual bool is_main() const = 0;
  /// The services of the whole application.
  [[nodiscard]] virtual const std::set<std::string>& services() const = 0;
  /// Declares the publishers of a component that runs elsewhere; within its constructor.
  virtual void declare(detail::ComponentCore& component) = 0;

  /// All sources of this process have finished: the run ends when those of all have.
  virtual void sources_finished() = 0;

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
  /// All have started here: waits for the others, and returns when timers start everywhere.
  [[nodiscard]] virtual Time agree_on_begin(const std::function<bool()>& is_over) = 0;

  /// What all do together at the end, in this order; each waits until all others came as far.
  enum class Step : std::uint8_t { kTimersStopped, kDrained, kDrainedAgain };
  virtual void reach(Step step) = 0;
  /// As for the starts, in the reverse order.
  virtual void reach_stop(std::size_t place) = 0;
  virtual void await_stop(const detail::ComponentCore& component, std::size_t place) = 0;
  /// All have stopped here.
  virtual void end() = 0;
};

}  // namespace fastcycle::host

#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "base/thread.h"
#include "broker/read_ring.h"
#include "broker/topics.h"
#include "config/problem.h"
#include "executor/activation_ring.h"
#include "executor/peer_activity.h"

namespace fastcycle::host {

class Application;
struct ComponentNews;

/// What an observer may look at while the application runs.
struct ObserverView {
  const Application& application;
  /// One a worker: what each component does, read by `ActivationRing::read`, which counts what
  /// was lost.
  std::vector<const detail::ActivationRing*> rings;
  /// One a component, in the order of the application file: what its activations learn, if an
  /// observer wants to know that; else none.
  std::vector<const detail::ReadRing*> reads;
  /// The same of other processes, where the application has several.
  std::vector<const detail::PeerActivity*> peers = {};
};

/// A tool that looks on while an application runs: a recorder, a tracer, a watchdog.
///
/// The application knows its observers by this class only. It calls those that were added, in the
/// order in which they were; an application without observers does nothing for them, and an
/// observer that taps no topic and wants no overflows costs its publishers and callbacks nothing.
///
/// @threads  As each function says.
class Observer {
 public:
  Observer() = default;
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;
  virtual ~Observer() = default;

  /// All components are constructed and fit together, no topic is connected yet: here an observer
  /// taps topics. Control thread.
  virtual void tap([[maybe_unused]] detail::Topics& topics) {}
  /// The topics are connected. Control thread; what fails here keeps the application from starting.
  virtual void open([[maybe_unused]] config::Problems& problems) {}

  /// Before the first component starts. What the machine refuses is added to `refusals`. Control
  /// thread.
  virtual void start([[maybe_unused]] const ObserverView& view,
                     [[maybe_unused]] std::vector<base::Refusal>& refusals) {}

  /// Simulated time only: a round is over, `step` is its place in its moment. On the thread that
  /// runs the simulation.
  virtual void round_ended([[maybe_unused]] std::uint32_t step) {}

  /// Component `component` faulted. On the worker that served it, or the control thread.
  ///
  /// @realtime Must not wait: what `component` and `what` point to is gone afterwards.
  virtual void faulted([[maybe_unused]] std::string_view component,
                       [[maybe_unused]] std::string_view what) noexcept {}

  /// A component has another health, fault or state. In its activation.
  ///
  /// @realtime Must not wait.
  virtual void changed([[maybe_unused]] const ComponentNews& news) noexcept {}
  /// Whether `changed` is to be called; asked once, before the topics are connected.
  [[nodiscard]] virtual bool wants_changes() const { return false; }

  /// Whether components keep what their activations learn; asked once, before the start.
  [[nodiscard]] virtual bool wants_reads() const { return false; }

  /// Whether `overflowed` is to be called; asked once, before the topics are connected.
  [[nodiscard]] virtual bool wants_overflows() const { return false; }
  /// A queue was full: one message for `subscription` was dropped. On the publisher's thread.
  ///
  /// @realtime As `publish`: no lock, no allocation, no system call.
  virtual void overflowed([[maybe_unused]] const detail::Subscription& subscription) noexcept {}

  /// All components have stopped, and still exist. Control thread.
  virtual void stop([[maybe_unused]] const Application& application) {}
};

}  // namespace fastcycle::host

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

/// Data that an observer may read while the application runs.
struct ObserverView {
  const Application& application;
  /// One per worker: the activations of its components, read by `ActivationRing::read`, which
  /// counts lost ones.
  std::vector<const detail::ActivationRing*> rings;
  /// One per component, in the order of the application file: the reads of its activations, if an
  /// observer wants reads; else none.
  std::vector<const detail::ReadRing*> reads;
  /// The same for other processes, if the application has several.
  std::vector<const detail::PeerActivity*> peers = {};
};

/// A tool that observes a running application: a recorder, a tracer, a watchdog.
///
/// The application uses observers through this class only, and calls them in the order in which
/// they were added. An observer that taps no topic and wants no overflows costs publishers and
/// callbacks nothing.
///
/// @threads  Stated for each function.
class Observer {
 public:
  Observer() = default;
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;
  virtual ~Observer() = default;

  /// All components are constructed and checked, no topic is connected yet: here an observer taps
  /// topics. Control thread.
  virtual void tap([[maybe_unused]] detail::Topics& topics) {}
  /// The topics are connected. Control thread; an error here prevents the start.
  virtual void open([[maybe_unused]] config::Problems& problems) {}

  /// Before the first component starts. Adds what the machine refuses to `refusals`. Control
  /// thread.
  virtual void start([[maybe_unused]] const ObserverView& view,
                     [[maybe_unused]] std::vector<base::Refusal>& refusals) {}

  /// Simulated time only: a round has ended, `step` is its index in its instant. On the thread that
  /// runs the simulation.
  virtual void round_ended([[maybe_unused]] std::uint32_t step) {}

  /// Component `component` faulted. On the worker that served it, or the control thread; for one of
  /// another process, which may have ended, on the thread that takes notices.
  ///
  /// @realtime Must not wait. `component` and `what` are valid during the call only.
  virtual void faulted([[maybe_unused]] std::string_view component,
                       [[maybe_unused]] std::string_view what) noexcept {}

  /// A component's health, faults or state changed. In its activation.
  ///
  /// @realtime Must not wait.
  virtual void changed([[maybe_unused]] const ComponentNews& news) noexcept {}
  /// Whether `changed` is to be called; called once, before the topics are connected.
  [[nodiscard]] virtual bool wants_changes() const { return false; }

  /// News of a component in another process. On the thread that takes notices.
  ///
  /// @realtime Must not wait.
  virtual void changed_elsewhere([[maybe_unused]] const ComponentNews& news) noexcept {}

  /// Whether components record the reads of their activations; called once, before the start.
  [[nodiscard]] virtual bool wants_reads() const { return false; }

  /// Whether `overflowed` is to be called; called once, before the topics are connected.
  [[nodiscard]] virtual bool wants_overflows() const { return false; }
  /// A queue was full: one message for `subscription` was dropped. On the publisher's thread.
  ///
  /// @realtime As `publish`: no lock, no allocation, no system call.
  virtual void overflowed([[maybe_unused]] const detail::Subscription& subscription) noexcept {}

  /// All components have stopped, and still exist. Control thread.
  virtual void stop([[maybe_unused]] const Application& application) {}
};

}  // namespace fastcycle::host

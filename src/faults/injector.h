#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/sleepers.h"
#include "base/thread.h"
#include "broker/topics.h"
#include "config/description.h"
#include "config/problem.h"
#include "executor/simulation.h"
#include "faults/gate.h"

namespace fastcycle::faults {

/// How often a fault acted: on messages, or on its component.
struct FaultCount {
  std::string name;
  config::FaultKind kind;
  std::string target;  ///< The topic, or the component.
  std::uint64_t count = 0;
  std::vector<std::uint64_t> messages = {};  ///< Sequences of those affected, the first 1000.
};

/// Injects the faults of an application: owns the gates before the lanes, and schedules their
/// messages.
///
///     Injector injector(description.faults, clock);
///     injector.attach(topics, problems);            // before anything is connected
///     injector.strike = …;                          // what a fault of a component is
///     injector.begin(start_of_timers);
///     injector.end();
///
/// In simulated time it is a feed of the simulation; live it has a thread.
///
/// @threads  Confined to the control thread; as a feed to that of the simulation.
class Injector final : public detail::Feed {
 public:
  Injector(const config::FaultsDescription& faults, const base::Clock& clock);
  ~Injector() override;

  /// Attaches gates to all publishers that faults select. A fault without a match, or with an
  /// unknown field, is an error if `is_whole`: all topics are here.
  void attach(detail::Topics& topics, bool is_whole, config::Problems& problems);

  /// A fault of a component or a process begins, or, with `is_over`, ends. Before `begin`.
  std::function<void(const config::FaultDescription& fault, bool is_over)> strike =
      [](const config::FaultDescription&, bool) {};

  /// In simulated time: sets the other feed. Before `begin`.
  void set_other(detail::Feed& other) noexcept { other_ = &other; }

  /// The timers started at `start`: faults act from now on. In a restarted process, `start` is in
  /// the past: earlier faults are not repeated.
  void begin(Time start, std::vector<base::Refusal>& refusals);
  /// Ends all faults, and drops messages that are still delayed.
  void end();

  [[nodiscard]] std::vector<FaultCount> counts() const;
  /// The injected faults in a sentence, to mark the run.
  [[nodiscard]] std::string summary() const;

  [[nodiscard]] std::int64_t next_due_ns() const noexcept override;
  [[nodiscard]] std::uint32_t next_step() const noexcept override;
  void put(Time now, std::uint32_t step) override;

 private:
  /// When a component is struck.
  struct Strike {
    Time time;
    ActiveFault* fault;
    bool is_over;
  };

  void check(const ActiveFault& fault, const detail::Topics& topics,
             config::Problems& problems) const;
  [[nodiscard]] std::int64_t own_due_ns() const noexcept;
  void put_due(Time now);
  void run_live();

  const base::Clock& clock_;
  GateClock gate_clock_;
  std::deque<ActiveFault> faults_;
  std::vector<std::unique_ptr<Gate>> gates_;
  std::vector<detail::PublisherCore*> gated_;
  std::deque<Strike> strikes_;  ///< The pending ones, the next one first.
  detail::Feed* other_ = nullptr;

  // Live.
  base::Sleepers sleepers_;
  std::atomic<bool> is_stopping_{false};
  std::atomic<std::uint64_t> changes_{0};
  base::Thread thread_;
};

}  // namespace fastcycle::faults

#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "base/histogram.h"
#include "base/priority_mutex.h"
#include "broker/publisher_core.h"
#include "broker/quality.h"
#include "executor/activation_ring.h"
#include "fastcycle/component.h"

namespace fastcycle::detail {

class Actor;

/// The purpose of a timer.
struct TimerRole {
  std::string name = {};          ///< In reports; empty: "timer 2", by its number.
  std::string label = "a timer";  ///< As text, for faults.
  Cause cause = Cause::kTick;     ///< Of its activations.
};

/// How long the callbacks of one timer take. It outlives the timer: a component that is restarted
/// creates its timers again, and each continues with its statistics.
struct TimerStatistics {
  TimerStatistics(std::string its_name, Cause its_cause)
      : name(std::move(its_name)), cause(its_cause) {}

  const std::string name;
  const Cause cause;
  bool is_taken = true;            ///< By a present timer.
  base::CoarseHistogram run_time;  ///< Ns by CLOCK_MONOTONIC. Written by the component's worker.
};

/// One timer of a component; periodic, or armed once.
class TimerCore {
 public:
  TimerCore(Actor& its_actor, std::uint64_t its_number, const TimerOptions& its_options,
            TickCallback its_callback, TimerRole its_role)
      : actor(its_actor),
        number(its_number),
        options(its_options),
        callback(std::move(its_callback)),
        role(std::move(its_role)) {}

  [[nodiscard]] bool is_periodic() const noexcept { return options.period > Duration(0); }

  Actor& actor;
  const std::uint64_t number;
  const TimerOptions options;
  TickCallback callback;
  const TimerRole role;
  Watch* watch = nullptr;                 ///< If set, there is an activation only for its events.
  TimerStatistics* statistics = nullptr;  ///< None if it has a watch.
  std::int64_t due_ns = base::kNever;     ///< On the application's clock.
  std::uint64_t armed_in_turn = 0;        ///< In simulated time a timer fires once a round.
};

/// The timers of one component: when each is due, what it watches, and how it is armed again.
///
/// @threads  `statistics` is Safe; all else is confined to the worker that serves the component,
///           and to the control thread before the start and after the end.
class TimerSet {
 public:
  explicit TimerSet(const base::Clock& clock) : clock_(clock) {}
  TimerSet(const TimerSet&) = delete;
  TimerSet& operator=(const TimerSet&) = delete;

  TimerCore& add(Actor& actor, const TimerOptions& options, TickCallback callback, TimerRole role);
  /// Adds a timer that checks `watch`, which must outlive it, from `now_ns` on; with `base::kNever`
  /// from the start of the timers on.
  TimerCore& add_watch(Actor& actor, Watch& watch, std::int64_t now_ns);
  /// Adds a timer that is due when credits of `publisher` are available again after they had run
  /// out.
  void add_credit_event(Actor& actor, PublisherCore& publisher, std::function<void()> callback);

  /// A turn begins: in simulated time each timer fires once in a turn.
  void begin_turn() noexcept { ++turn_; }

  [[nodiscard]] bool is_empty() const noexcept { return timers_.empty(); }
  /// The timer that is due first of those due at `now_ns`; null if none is.
  [[nodiscard]] TimerCore* due(std::int64_t now_ns) noexcept;
  /// The tick of `timer`, which is due, and when it is due next. A tick that is a whole period late
  /// replaces the missed ones.
  [[nodiscard]] Tick take(TimerCore& timer, std::int64_t now_ns) noexcept;
  /// The watch of `timer` was checked: schedules its next check.
  void look_again(TimerCore& timer) noexcept;

  void arm(TimerCore& timer, std::int64_t due_ns) noexcept;
  /// Makes the timers of credit events due whose credits were returned.
  void take_credits(std::int64_t now_ns) noexcept;

  /// Arms all periodic timers and all watches, as of `start`.
  void start(Time start);
  void cancel() noexcept;
  /// Destroys all timers, which their owners declare again; statistics are kept.
  void clear() noexcept;

  /// When the next timer is due, on the application's clock.
  [[nodiscard]] std::int64_t next_due_ns() const noexcept;

  /// In the order in which they were added.
  [[nodiscard]] const std::vector<std::unique_ptr<TimerCore>>& all() const noexcept {
    return timers_;
  }
  /// Of all past and present timers, except watches, in the order in which they were added.
  /// @threads Safe; the result is valid as long as this.
  [[nodiscard]] std::vector<const TimerStatistics*> statistics() const;

 private:
  /// The publisher whose credits are awaited, and the timer that is due when they are available.
  struct CreditEvent {
    PublisherCore* publisher;
    TimerCore* timer;
  };

  TimerStatistics& statistics_of(const std::string& name, Cause cause);

  const base::Clock& clock_;
  std::uint64_t turn_ = 0;
  std::vector<std::unique_ptr<TimerCore>> timers_;
  std::vector<CreditEvent> credit_events_;
  bool is_on_ = true;  ///< False once all are cancelled, until they start again.

  // Locked to create timers, and to read their statistics.
  mutable base::PriorityMutex mutex_;
  std::deque<TimerStatistics> statistics_;
};

}  // namespace fastcycle::detail

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

/// What a timer is for.
struct TimerRole {
  std::string name = {};          ///< In reports; empty: "timer 2", by its number.
  std::string label = "a timer";  ///< In words, for faults.
  Cause cause = Cause::kTick;     ///< Of its activations.
};

/// How long the callbacks of one timer take. It outlives the timer: a component that is restarted
/// makes its timers again, and each goes on with what it had.
struct TimerStatistics {
  TimerStatistics(std::string its_name, Cause its_cause)
      : name(std::move(its_name)), cause(its_cause) {}

  const std::string name;
  const Cause cause;
  bool is_taken = true;            ///< By a timer that there is now.
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
  Watch* watch = nullptr;                 ///< Then there is an activation only if it has an event.
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
  /// A timer that looks after `watch`, which must outlive it, from `now_ns` on; with `base::kNever`
  /// from the start of the timers on.
  TimerCore& add_watch(Actor& actor, Watch& watch, std::int64_t now_ns);
  /// A timer that is due when credits of `publisher`, which had run out, are there again.
  void add_credit_event(Actor& actor, PublisherCore& publisher, std::function<void()> callback);

  /// A turn begins: in simulated time each timer fires once in a turn.
  void begin_turn() noexcept { ++turn_; }

  [[nodiscard]] bool is_empty() const noexcept { return timers_.empty(); }
  /// The timer that is due first of those due at `now_ns`; null if none is.
  [[nodiscard]] TimerCore* due(std::int64_t now_ns) noexcept;
  /// The tick of `timer`, which is due, and when it is due next. What is a whole period late stands
  /// for the ticks that it missed.
  [[nodiscard]] Tick take(TimerCore& timer, std::int64_t now_ns) noexcept;
  /// The watch of `timer` was asked: it is due when that wants to be asked next.
  void look_again(TimerCore& timer) noexcept;

  void arm(TimerCore& timer, std::int64_t due_ns) noexcept;
  /// Makes the timers of credit events due whose credits came.
  void take_credits(std::int64_t now_ns) noexcept;

  /// Arms all periodic timers and all watches, as of `start`.
  void start(Time start);
  void cancel() noexcept;
  /// Destroys all timers, which their owners declare again; statistics stay.
  void clear() noexcept;

  /// When the next timer is due, on the application's clock.
  [[nodiscard]] std::int64_t next_due_ns() const noexcept;

  /// In the order in which they were added.
  [[nodiscard]] const std::vector<std::unique_ptr<TimerCore>>& all() const noexcept {
    return timers_;
  }
  /// Of all timers that there ever were, but watches, in the order in which they were added.
  /// @threads Safe; what it returns lives as long as this.
  [[nodiscard]] std::vector<const TimerStatistics*> statistics() const;

 private:
  /// Whose credits are waited for, and the timer that is due when they are there.
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

  // Taken when timers are made, and by who looks at their statistics.
  mutable base::PriorityMutex mutex_;
  std::deque<TimerStatistics> statistics_;
};

}  // namespace fastcycle::detail

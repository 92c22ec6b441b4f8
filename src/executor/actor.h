#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "base/histogram.h"
#include "broker/publisher_core.h"
#include "broker/quality.h"
#include "broker/subscription.h"
#include "executor/activation_ring.h"
#include "fastcycle/component.h"
#include "fastcycle/synchronizer.h"

namespace fastcycle::detail {

class Actor;
class Synchronizer;
class TimerCore;

/// A subscription whose messages are given to a callback.
class CallbackSubscription : public Subscription {
 public:
  CallbackSubscription(Topic& its_topic, Actor& its_actor, const SubscriberOptions& options,
                       EnvelopeCallback its_callback, Kind its_kind = Kind::kCallback);

  Actor& actor;
  /// On the heap, so that it stays where it is when the subscription ends while it runs.
  std::unique_ptr<EnvelopeCallback> callback;
  Cause cause = Cause::kMessage;  ///< Of its activations.
  bool is_ended = false;
  /// Its callback is the framework's: it goes on after a fault, and while the component is not
  /// active.
  bool outlives_faults = false;
  /// Time in its callback, ns by CLOCK_MONOTONIC. Written by the component's worker.
  base::CoarseHistogram run_time;
};

/// The last messages of a topic, taken over when an activation starts.
class View final : public Subscription {
 public:
  View(Topic& its_topic, Actor& its_actor, Kind its_kind, std::size_t its_depth,
       std::optional<Duration> its_span, std::optional<Duration> its_lifespan = {});
  ~View() override;

  /// Takes over `envelope` and its reference; the oldest gives way.
  void insert(Envelope* envelope);
  /// Lets go of what is older than the span, or than its lifespan.
  void forget_old(Time now) noexcept;
  void clear() noexcept;

  Actor& actor;
  const std::optional<Duration> span;
  std::vector<Envelope*> held;  ///< By publish time, oldest first.
};

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

/// Who is told when a component's next timer changes.
class TimerWatch {
 public:
  TimerWatch() = default;
  TimerWatch(const TimerWatch&) = delete;
  TimerWatch& operator=(const TimerWatch&) = delete;
  virtual ~TimerWatch() = default;

  /// A timer of some component is due at `due_ns`: CLOCK_MONOTONIC when live, else simulated time.
  virtual void timer_armed(std::int64_t due_ns) noexcept = 0;
};

/// What one component did, counted by the worker that serves it.
struct ActorStatistics {
  Counter activations;
  Counter faults;
  Counter overruns;          ///< Ticks skipped, over all timers.
  base::Histogram callback;  ///< Time in all callbacks, ns by CLOCK_MONOTONIC.
  base::Histogram lateness;  ///< From a tick's due time to its callback, ns.
};

/// A component as the executor sees it: an inbox, timers, control causes, and one worker at a time
/// that serves them in the order of their keys.
///
/// @threads  `post` is Safe; all else is confined to the worker that serves it, and to the control
///           thread before the start and after the end.
class Actor {
 public:
  Actor(std::string name, std::uint32_t index, const base::Clock& clock);
  Actor(const Actor&) = delete;
  Actor& operator=(const Actor&) = delete;
  virtual ~Actor();

  /// Puts a control cause in front of everything that waits. In simulated time, and from within a
  /// callback, it is `from` that stages it until its round is over.
  void post(Cause cause, std::function<void()> body, Actor* from = nullptr);
  /// As `post`; calls `finished` when the activation has ended, its fault, if any, included.
  void post_and_tell(Cause cause, std::function<void()> body, std::function<void()> finished);

  /// Whether something waits for the end of the round.
  [[nodiscard]] bool has_staged() const noexcept { return !staged_.empty(); }

  /// In simulated time: does `action` when the present round is over. From within a callback only.
  void stage(std::function<void()> action) { staged_.push_back({.action = std::move(action)}); }

  /// Serves a turn (live): at most 16 activations or 1 ms.
  void run_turn(ActivationRing& ring);

  /// Serves the oldest message, if nothing else waits, before its publisher has marked the inbox
  /// (live); `now_ns` is CLOCK_MONOTONIC just before. Only by a worker that is the component's only
  /// one: so it takes no hold of the state word.
  ///
  /// The bit that the publisher sets then gives one more turn, which finds nothing and ends.
  bool run_early(ActivationRing& ring, std::int64_t now_ns);

  /// Serves all causes up to the clock's time (simulated).
  void run_round(ActivationRing& ring);

  /// Hands over what was published and posted in a simulated round.
  void hand_over_stage();

  /// In simulated time: how long a turn that publishes or posts something takes it. What it did is
  /// seen by others when this is over, and it serves nothing else until then. Before the start.
  void set_simulated_cost(Duration cost) noexcept { publishing.simulated_cost = cost; }
  [[nodiscard]] Duration simulated_cost() const noexcept { return publishing.simulated_cost; }

  /// From now on messages and timers are served; until then only control causes are.
  void open() noexcept { gate_.store(Gate::kOpen, std::memory_order_relaxed); }
  [[nodiscard]] bool is_open() const noexcept {
    return gate_.load(std::memory_order_relaxed) == Gate::kOpen;
  }

  /// From now on only control causes and the alarm are served: what waits for a callback and what
  /// still comes is `dropped{inactive}`, except for the last messages of latched topics, which go
  /// on waiting. Views go on. Cancels all timers.
  void suspend() noexcept;
  /// Drops what came until now, and serves again.
  void resume() noexcept;
  [[nodiscard]] bool is_suspended() const noexcept {
    return gate_.load(std::memory_order_relaxed) == Gate::kSuspended;
  }
  /// Drops what waits for callbacks as inactive, latched messages too.
  void drop_waiting() noexcept;

  /// Whether what `armed_due_ns` says is served when it is due.
  [[nodiscard]] bool is_ticking() const noexcept {
    return gate_.load(std::memory_order_relaxed) != Gate::kClosed;
  }

  /// While suspended: calls `action` once, at `due`, as an activation of the life cycle.
  void set_alarm(Time due, std::function<void()> action);
  void cancel_alarm() noexcept;

  /// While suspended: timers may be armed, for it is resumed next. Without it they stay as they
  /// are.
  void set_resuming(bool is_resuming) noexcept { is_resuming_ = is_resuming; }

  /// Arms all periodic timers, as of `start`.
  void start_timers(Time start);
  void cancel_timers() noexcept;
  /// Forgets all timers: what a restarted component declares again.
  void clear_timers() noexcept;

  /// Closes all subscriptions: what waits and still comes is dropped for `reason`. After a fault
  /// those that outlive it stay open.
  void close(DropReason reason) noexcept;

  CallbackSubscription& subscribe(Topic& topic, const SubscriberOptions& options,
                                  EnvelopeCallback callback);
  /// As `subscribe`, in the place of an ended subscription of that topic, if there is one: a
  /// component that subscribes again and again keeps one ledger.
  CallbackSubscription& subscribe_again(Topic& topic, const SubscriberOptions& options,
                                        EnvelopeCallback callback);
  void end(CallbackSubscription& subscription,
           DropReason reason = DropReason::kUnsubscribed) noexcept;
  /// Calls `callback` with messages of `topics` that belong together; `queues` says, for each
  /// topic, how many messages may wait before that.
  Synchronizer& synchronize(std::span<Topic* const> topics,
                            std::span<const SubscriberOptions> queues,
                            const SynchronizerOptions& options, EnvelopeSetCallback callback);
  /// Lets go of all that synchronizers hold: it counts as dropped for `reason`.
  void drop_held(DropReason reason) noexcept;
  TimerCore& add_timer(const TimerOptions& options, TickCallback callback, TimerRole role = {});
  /// In the order in which they were added; before the start, and after the end.
  [[nodiscard]] const std::vector<std::unique_ptr<TimerCore>>& timers() const noexcept {
    return timers_;
  }
  /// Of all timers that it ever had, but watches, in the order in which they were added.
  /// @threads Safe; what it returns lives as long as the component.
  [[nodiscard]] std::vector<const TimerStatistics*> timer_statistics() const;
  /// A timer that looks after `watch`, which must outlive it; from now on in an activation, else
  /// from the start of the timers on.
  TimerCore& add_watch(Watch& watch);
  /// Looks after the quality of service of `subscription`, if it asks for one.
  void watch(CallbackSubscription& subscription);
  void arm(TimerCore& timer, Time due) noexcept;
  /// Calls `callback`, by cause event, when credits of `publisher` that had run out are there
  /// again.
  void on_credits(PublisherCore& publisher, std::function<void()> callback);

  /// Asks the world whether the component has nothing to do: for the end of a run.
  [[nodiscard]] bool is_quiet() const noexcept { return inbox.is_quiet(); }

  /// When the next timer is due, as `TimerWatch` says it.
  [[nodiscard]] std::int64_t armed_due_ns() const noexcept {
    return armed_due_ns_.load(std::memory_order_seq_cst);
  }
  /// Takes a due timer's word for it: true once for each time that it was armed.
  bool take_due(std::int64_t due_ns) noexcept {
    return armed_due_ns_.compare_exchange_strong(due_ns, base::kNever, std::memory_order_seq_cst);
  }

  // Constant once the application is built.
  const std::string name;
  const std::uint32_t index;
  const base::Clock& clock;
  TimerWatch* timer_watch = nullptr;

  Inbox inbox;
  PublishingComponent publishing;
  ActorStatistics statistics;
  std::vector<View*> views;
  std::vector<CallbackSubscription*> callbacks;
  std::vector<std::unique_ptr<Synchronizer>> synchronizers;

  /// Remembers when what was delivered was taken, for what timers publish.
  void hold(const Envelope& envelope) noexcept;

  /// How many roots latency chains have; before it subscribes to anything.
  void set_root_count(std::size_t count);
  [[nodiscard]] std::size_t root_count() const noexcept { return held_trails_.size(); }

 protected:
  /// A callback threw `what`; called in the same turn, after the activation ended.
  virtual void on_fault(std::string_view what) = 0;

  /// A message came too late for the chain at this place of the application file, and is delivered
  /// next, or dropped. In a turn, but in no activation.
  virtual void on_breach([[maybe_unused]] std::size_t chain) {}

 private:
  struct Control {
    Cause cause;
    std::function<void()> body;
    std::function<void()> finished = {};
  };
  /// A message, or something else that must wait until a simulated round is over.
  struct Staged {
    PublisherCore* publisher = nullptr;
    Envelope* envelope = nullptr;
    std::function<void()> action = {};
  };
  class ActorStage final : public Stage {
   public:
    explicit ActorStage(Actor& actor) : actor_(actor) {}
    void put(PublisherCore& publisher, Envelope* envelope) override {
      actor_.staged_.push_back({.publisher = &publisher, .envelope = envelope});
    }

   private:
    Actor& actor_;
  };

  /// Whose credits are waited for, and the timer that is due when they are there.
  struct CreditEvent {
    PublisherCore* publisher;
    TimerCore* timer;
  };

  /// The newest taken time delivered per root: what a timer's messages inherit.
  struct HeldRoot {
    PublisherId root = 0;
    Time taken{};
  };

  /// Calls `body` as an activation; `where()` says, for a fault, what it was that threw. `run_time`
  /// is that of the callback, if it has one of its own.
  template <typename Body, typename Where>
  void activate(ActivationRing& ring, ActivationRecord record, const Origin& origin,
                base::CoarseHistogram* run_time, const Body& body, const Where& where);
  void run_controls(ActivationRing& ring);
  void run_control(ActivationRing& ring, const Control& control);
  /// While suspended: serves one message of what outlives that; false if there is none.
  bool serve_outliving(ActivationRing& ring);
  /// What a suspended component does; true if there may be more at once.
  bool serve_suspended(ActivationRing& ring);
  void drop_inactive(bool with_latched) noexcept;
  bool run_next(ActivationRing& ring);
  void put_in_front(Control control);
  void tick(ActivationRing& ring, TimerCore& timer);
  /// Looks whether `timer`'s watch has something to tell.
  void look(ActivationRing& ring, TimerCore& timer);
  void tell(ActivationRing& ring, const Watch& watch, const QosEvent& event);
  /// Takes what `peek` found, if it is to be delivered now; tells what there is to tell of it.
  bool judge(ActivationRing& ring, const Inbox::Head& head);
  /// As `judge`, for what a subscription asks for beyond depth and overflow.
  bool judge_quality(ActivationRing& ring, const Inbox::Head& head);
  /// Judges `envelope`, which would be delivered at `now`, for the chains that end there; false if
  /// it is to be dropped.
  bool judge_chains(Subscription& subscription, const Envelope& envelope, Time now);
  /// Serves what `peek` found; false if it is gone.
  bool take(ActivationRing& ring, const Inbox::Head& head);
  void deliver(ActivationRing& ring, const Inbox::Head& head);
  void finish_leftovers() noexcept;
  void take_credit_events() noexcept;
  /// Gives a credit back, in simulated time when the round is over.
  void give_back(std::shared_ptr<LaneCredit> credit);
  void end_credits(const Subscription& subscription) noexcept;
  void refresh_views();
  [[nodiscard]] Origin oldest_held() const noexcept;
  TimerStatistics& statistics_of_timer(const std::string& its_name, Cause cause);
  [[nodiscard]] TimerCore* due_timer(std::int64_t now_ns) noexcept;
  void publish_due() noexcept;

  ActorStage stage_;
  enum class Gate : std::uint8_t { kClosed, kOpen, kSuspended };
  std::atomic<Gate> gate_{
      Gate::kClosed};  ///< Written by its worker, read by who waits for the end.
  bool is_resuming_ = false;
  std::int64_t alarm_ns_ = base::kNever;  ///< On the application's clock.
  std::function<void()> alarm_;
  /// CLOCK_MONOTONIC as last read in this turn: when an activation ends, the next one begins.
  std::int64_t read_ns_ = 0;
  std::uint64_t number_ = 0;
  std::uint64_t turn_ = 0;
  std::vector<std::unique_ptr<TimerCore>> timers_;
  std::vector<CreditEvent> credit_events_;
  bool are_timers_on_ = true;       ///< False once all are cancelled, until they start again.
  std::vector<Trail> held_trails_;  ///< By root.
  std::array<HeldRoot, 16> held_{};
  std::size_t held_count_ = 0;
  std::vector<Staged> staged_;
  /// Callbacks of ended subscriptions, until they returned.
  std::vector<std::unique_ptr<EnvelopeCallback>> dying_;
  std::string fault_;

  // Taken when timers are made, and by who looks at their statistics.
  mutable std::mutex timer_mutex_;
  std::deque<TimerStatistics> timer_statistics_;

  std::atomic<std::int64_t> armed_due_ns_{base::kNever};

  // Taken only when a control cause is posted or served: connecting, life cycle, jobs done.
  std::mutex control_mutex_;
  std::vector<Control> controls_;
  /// Written under the mutex. Set before what is published after `post` returned.
  alignas(64) std::atomic<bool> has_controls_{false};
};

}  // namespace fastcycle::detail

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "executor/activation_ring.h"
#include "executor/activator.h"
#include "executor/actor_base.h"
#include "executor/actor_credits.h"
#include "executor/control_queue.h"
#include "executor/delivery_filter.h"
#include "executor/due_time.h"
#include "executor/held_origins.h"
#include "executor/round_stage.h"
#include "executor/script.h"
#include "executor/subscription_set.h"
#include "executor/subscriptions.h"
#include "executor/suspension.h"
#include "executor/timer_set.h"
#include "executor/turn_clock.h"
#include "fastcycle/component.h"
#include "fastcycle/synchronizer.h"

namespace fastcycle::detail {

/// A component as seen by the executor: served by one worker at a time, in turns; the worker takes
/// the next cause, executes it as an activation, and updates the statistics.
///
/// Its parts: `Inbox` (messages), `TimerSet` (ticks), `ControlQueue` (all other causes),
/// `Suspension` (whether it is served at all), `DeliveryFilter` (whether a message is),
/// `HeldOrigins` (what it inherits if no message is the cause), `SubscriptionSet` (its
/// subscriptions), `Activator` (how it is called), `ActorCredits` (credits to return), `RoundStage`
/// (what waits for the end of a simulated round), `DueTime` (when it is to be served next).
///
/// @threads  `post` and `post_and_notify` are Safe; all else is confined to the worker that serves
/// it,
///           and to the control thread before the start and after the end.
class Actor : public ActorBase {
 public:
  Actor(std::string name, std::uint32_t index, const base::Clock& clock);
  Actor(const Actor&) = delete;
  Actor& operator=(const Actor&) = delete;
  virtual ~Actor();

  /// Queues a control cause before everything that waits. In simulated time, and from within a
  /// callback, `from` stages it until the end of its round.
  ///
  /// `key` identifies it among others of its cause, in the log of the run.
  void post(Cause cause, std::function<void()> body, Actor* from = nullptr, std::uint64_t key = 0);
  /// From within a callback of this component: queues a cause behind all messages published so far.
  ///
  /// @errors  std::runtime_error if more than `ControlQueue::kMaxOwn` of them wait.
  void post_own(Cause cause, std::function<void()> body);
  /// As `post`; calls `finished` when the activation has ended, its fault, if any, included.
  void post_and_notify(Cause cause, std::function<void()> body, std::function<void()> finished,
                       std::uint64_t key = 0);

  /// Whether anything waits for the end of the round.
  [[nodiscard]] bool has_staged() const noexcept { return !stage_.is_empty(); }

  /// In simulated time: executes `action` at the end of the present round. From within a callback
  /// only.
  void stage(std::function<void()> action) { stage_.put(std::move(action)); }

  /// Serves a turn (live): at most 16 activations or 1 ms.
  void run_turn(ActivationRing& ring);

  /// Serves the oldest message, if nothing else waits, before its publisher has marked the inbox
  /// (live); `now_ns` is CLOCK_MONOTONIC just before. Only by the component's only worker, so it
  /// need not claim the state word.
  ///
  /// The bit that the publisher sets later causes one more turn, which finds nothing and ends.
  bool run_early(ActivationRing& ring, std::int64_t now_ns);

  /// Serves all causes up to the clock's time (simulated).
  void run_round(ActivationRing& ring);

  // In a replay the log determines what is served next. These replace turns and rounds; each is one
  // activation at the clock's time.

  /// Sets the number and the reads of the next activation, which outlive it.
  void repeat_next(std::uint64_t number, ReplayedReads& replayed) noexcept;
  /// `view` takes over a message of `lane`, and a reference to it. Before the activation.
  void repeat_view(View& view, const Lane& lane, Envelope* envelope);
  /// Takes over the reference to the message of `head`.
  void repeat(ActivationRing& ring, const Inbox::Head& head);
  void repeat(ActivationRing& ring, TimerCore& timer, const Tick& tick);
  void repeat(ActivationRing& ring, const Watch& watch, const QosEvent& event);
  void repeat(ActivationRing& ring, const Control& control);
  /// Whether something was posted with this cause and key.
  [[nodiscard]] bool has_posted(Cause cause, std::uint64_t key) {
    return controls_.has_posted(cause, key);
  }
  [[nodiscard]] bool has_own() const noexcept { return controls_.has_own(); }
  /// Serves what was posted with this cause and key; false if nothing was.
  [[nodiscard]] bool repeat_posted(ActivationRing& ring, Cause cause, std::uint64_t key);
  /// Serves the alarm; false if none is set.
  [[nodiscard]] bool repeat_alarm(ActivationRing& ring);
  /// Serves the next cause that it posted to itself; false if none is left.
  [[nodiscard]] bool repeat_own(ActivationRing& ring);
  /// Drops the next cause that others posted, as if it had been served, and returns it in
  /// `dropped`; false if there is none.
  bool drop_posted(Control& dropped);

  /// Lets only `script` determine what is served. Before the start, or between its activations.
  void follow(Script& script) noexcept;
  /// Serves waiting and due causes by itself again. As `follow`.
  void stop_following() noexcept;
  /// Sets the time of the next activation of one that follows.
  void follow_at(Time time) noexcept { turn_.hold(time); }

  /// Hands over what was published and posted in a simulated round.
  void hand_over_stage() { stage_.hand_over(); }

  /// In simulated time: the duration of a turn that publishes or posts something. Its effects are
  /// visible to others after this time, and it serves nothing else until then. Before the start.
  void set_simulated_cost(Duration cost) noexcept { publishing.simulated_cost = cost; }
  [[nodiscard]] Duration simulated_cost() const noexcept { return publishing.simulated_cost; }

  /// Starts to serve messages and timers; before, only control causes are served.
  void open() noexcept { suspension_.open(); }
  [[nodiscard]] bool is_open() const noexcept { return suspension_.is_open(); }

  /// Serves only control causes and the alarm: waiting and later messages are `dropped{inactive}`,
  /// except for the last messages of latched topics, which keep waiting. Views continue. Cancels
  /// all timers.
  void suspend() noexcept;
  /// As `suspend`, but messages keep waiting, as far as their queues have room.
  void suspend_keeping() noexcept;
  /// Drops messages received until now, unless they are kept, and serves again.
  void resume() noexcept;
  [[nodiscard]] bool is_suspended() const noexcept { return suspension_.is_suspended(); }
  /// Drops messages that wait for callbacks as inactive, latched ones too.
  void drop_waiting() noexcept;

  /// Whether the timer of `armed_due_ns` is served when it is due.
  [[nodiscard]] bool is_ticking() const noexcept { return !suspension_.is_closed(); }

  /// While suspended: calls `action` once, at `due`, as an activation of the life cycle.
  void set_alarm(Time due, std::function<void()> action) {
    suspension_.set_alarm(due, std::move(action));
  }
  void cancel_alarm() noexcept { suspension_.cancel_alarm(); }

  /// While suspended: allows timers to be armed, since it is resumed next. Otherwise they are not
  /// changed.
  void set_resuming(bool is_resuming) noexcept { suspension_.is_resuming = is_resuming; }

  /// Arms all periodic timers, as of `start`.
  void start_timers(Time start);
  void cancel_timers() noexcept;
  /// Removes all timers, which a restarted component declares again.
  void clear_timers() noexcept;

  /// Destroys all callbacks, once nothing is served any more: they may own handles of this
  /// component. Outside of activations.
  void release_callbacks() noexcept;

  /// Closes all subscriptions: waiting and later messages are dropped for `reason`. After a fault
  /// those that outlive it stay open.
  void close(DropReason reason) noexcept { subscriptions.close(reason); }

  CallbackSubscription& subscribe(Topic& topic, const SubscriberOptions& options,
                                  EnvelopeCallback callback);
  /// As `subscribe`, reusing an ended subscription of that topic, if there is one: a component that
  /// subscribes repeatedly keeps one ledger.
  CallbackSubscription& subscribe_again(Topic& topic, const SubscriberOptions& options,
                                        EnvelopeCallback callback);
  void end(CallbackSubscription& subscription,
           DropReason reason = DropReason::kUnsubscribed) noexcept {
    subscriptions.end(subscription, reason);
  }
  /// Calls `callback` with messages of `topics` that belong together; `queues` has, for each topic,
  /// how many messages may wait before that.
  Synchronizer& synchronize(std::span<Topic* const> topics,
                            std::span<const SubscriberOptions> queues,
                            const SynchronizerOptions& options, EnvelopeSetCallback callback) {
    return subscriptions.synchronize(topics, queues, options, std::move(callback));
  }
  /// Releases all messages that synchronizers hold, as dropped for `reason`.
  void drop_held(DropReason reason) noexcept { subscriptions.drop_held(reason); }
  TimerCore& add_timer(const TimerOptions& options, TickCallback callback, TimerRole role = {}) {
    return timers_.add(*this, options, std::move(callback), std::move(role));
  }
  /// In the order in which they were added; before the start, and after the end.
  [[nodiscard]] const std::vector<std::unique_ptr<TimerCore>>& timers() const noexcept {
    return timers_.all();
  }
  /// Of all its past and present timers, except watches, in the order in which they were added.
  /// @threads Safe; the result is valid as long as the component.
  [[nodiscard]] std::vector<const TimerStatistics*> timer_statistics() const {
    return timers_.statistics();
  }
  /// Adds a timer that checks `watch`, which must outlive it; in an activation from now on, else
  /// from the start of the timers on.
  TimerCore& add_watch(Watch& watch);
  /// Monitors the quality of service of `subscription`, if it has one.
  void watch(CallbackSubscription& subscription);
  void arm(TimerCore& timer, Time due) noexcept;
  /// Calls `callback`, by cause event, when credits of `publisher` are available again after they
  /// had run out.
  void on_credits(PublisherCore& publisher, std::function<void()> callback) {
    timers_.add_credit_event(*this, publisher, std::move(callback));
  }

  /// Whether the component has nothing to do: for the end of a run.
  [[nodiscard]] bool is_quiet() const noexcept { return inbox.is_quiet(); }

  /// When the next timer is due, as for `TimerWatch`.
  [[nodiscard]] std::int64_t armed_due_ns() const noexcept { return due_time_.get(); }
  /// Takes the due time: true once for each time that it was armed.
  bool take_due(std::int64_t due_ns) noexcept { return due_time_.take(due_ns); }

  TimerWatch* timer_watch = nullptr;  ///< Constant once the application is built.

  /// Clears the held origins, when the component's object is destroyed.
  void forget_held() noexcept { held_.clear(); }

  /// Sets the number of roots of latency chains; before it subscribes to anything.
  void set_root_count(std::size_t count);
  [[nodiscard]] std::size_t root_count() const noexcept { return held_.root_count(); }

 protected:
  /// A callback threw `what`; called in the same turn, after the activation ended.
  virtual void on_fault(std::string_view what) = 0;

  /// A watch has an event, before its callback is called. In a turn, but in no activation.
  virtual void on_qos_event([[maybe_unused]] const Watch& watch,
                            [[maybe_unused]] const QosEvent& event) {}

  /// A message was too late for the chain with this index in the application file, and is delivered
  /// next, or dropped. In a turn, but in no activation.
  virtual void on_breach([[maybe_unused]] std::size_t chain) {}

 private:
  /// The result of serving once.
  enum class Served : std::uint8_t {
    kOne,      ///< An activation.
    kNone,     ///< Nothing is left.
    kDropped,  ///< A message that is not delivered, or was gone.
  };

  /// Serves the next control cause that others posted; false if there is none.
  bool run_posted(ActivationRing& ring);
  /// While suspended: serves one message of a subscription that outlives that; false if there is
  /// none.
  bool serve_outliving(ActivationRing& ring);
  /// Serves a suspended component; true if there may be more to serve at once.
  bool serve_suspended(ActivationRing& ring);
  /// Serves the next cause of an open component; false if there is none.
  bool run_next(ActivationRing& ring);
  /// Serves one cause of this component in any state; false if there is none.
  bool serve(ActivationRing& ring);
  /// Ends a turn before everything was served.
  void end_turn_early() noexcept;
  /// Checks `timer`'s watch for an event.
  void look(ActivationRing& ring, TimerCore& timer);
  /// Judges the result of `peek`; `kOne` if an event was reported, `kNone` if it is to be
  /// delivered.
  Served judge(ActivationRing& ring, const Inbox::Head& head);
  void report_breaches(const Subscription& subscription, std::uint32_t breached);
  /// Serves the result of `peek`.
  Served take(ActivationRing& ring, const Inbox::Head& head);
  void publish_due() noexcept;

  RoundStage stage_;
  ActorCredits credits_{*this, stage_};
  TimerSet timers_{clock};
  ControlQueue controls_;
  std::uint64_t posted_own_in_ = 0;  ///< The activation in which
  std::uint64_t posted_own_ = 0;     ///< so many were posted by the component itself.
  HeldOrigins held_{publishing};
  Suspension suspension_;
  DueTime due_time_;
  TurnClock turn_{clock};
  Activator activator_;
  Script* script_ = nullptr;  ///< Null: it serves by itself.

 public:
  SubscriptionSet subscriptions;
};

}  // namespace fastcycle::detail

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

/// A component as the executor sees it: one turn at a time of one worker, which takes the next
/// cause, makes an activation of it, and accounts for it.
///
/// What it decides on is each a part of its own: `Inbox` (messages), `TimerSet` (ticks),
/// `ControlQueue` (all other causes), `Suspension` (whether it is served at all), `DeliveryFilter`
/// (whether a message is), `HeldOrigins` (what it inherits where no message is the cause),
/// `SubscriptionSet` (what it subscribed to), `Activator` (how it is called), `ActorCredits` (what
/// it owes publishers), `RoundStage` (what waits for the end of a simulated round), `DueTime` (when
/// it wants to be served next).
///
/// @threads  `post` and `post_and_tell` are Safe; all else is confined to the worker that serves
/// it,
///           and to the control thread before the start and after the end.
class Actor : public ActorBase {
 public:
  Actor(std::string name, std::uint32_t index, const base::Clock& clock);
  Actor(const Actor&) = delete;
  Actor& operator=(const Actor&) = delete;
  virtual ~Actor();

  /// Puts a control cause in front of everything that waits. In simulated time, and from within a
  /// callback, it is `from` that stages it until its round is over.
  ///
  /// `key` tells it from others of its cause, in the log of the run.
  void post(Cause cause, std::function<void()> body, Actor* from = nullptr, std::uint64_t key = 0);
  /// From within a callback of this component: puts a cause behind all that was published until
  /// now.
  ///
  /// @errors  std::runtime_error if more than `ControlQueue::kMaxOwn` of them wait.
  void post_own(Cause cause, std::function<void()> body);
  /// As `post`; calls `finished` when the activation has ended, its fault, if any, included.
  void post_and_tell(Cause cause, std::function<void()> body, std::function<void()> finished,
                     std::uint64_t key = 0);

  /// Whether something waits for the end of the round.
  [[nodiscard]] bool has_staged() const noexcept { return !stage_.is_empty(); }

  /// In simulated time: does `action` when the present round is over. From within a callback only.
  void stage(std::function<void()> action) { stage_.put(std::move(action)); }

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

  // Where a recorded run is executed again it is the log that says what is served next. In place of
  // turns and rounds; each is one activation at the clock's time.

  /// The number and the reads of the next activation, which live until it is over.
  void repeat_next(std::uint64_t number, ToldReads& told) noexcept;
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
  /// What was posted with this cause and key; false if nothing was.
  [[nodiscard]] bool repeat_posted(ActivationRing& ring, Cause cause, std::uint64_t key);
  /// The alarm; false if none is set.
  [[nodiscard]] bool repeat_alarm(ActivationRing& ring);
  /// The next of what it posted to itself; false if nothing is left of that.
  [[nodiscard]] bool repeat_own(ActivationRing& ring);
  /// Drops the next of what others posted, as if it had been served, and says in `dropped` what it
  /// was; false if there is none.
  bool drop_posted(Control& dropped);

  /// From now on `script` says what is served, and nothing else does. Before the start, or between
  /// its activations.
  void follow(Script& script) noexcept;
  /// It serves by itself again, as of now, what waits and what is due. As `follow`.
  void stop_following() noexcept;
  /// The next activation of one that follows is at `time`.
  void follow_at(Time time) noexcept { turn_.hold(time); }

  /// Hands over what was published and posted in a simulated round.
  void hand_over_stage() { stage_.hand_over(); }

  /// In simulated time: how long a turn that publishes or posts something takes it. What it did is
  /// seen by others when this is over, and it serves nothing else until then. Before the start.
  void set_simulated_cost(Duration cost) noexcept { publishing.simulated_cost = cost; }
  [[nodiscard]] Duration simulated_cost() const noexcept { return publishing.simulated_cost; }

  /// From now on messages and timers are served; until then only control causes are.
  void open() noexcept { suspension_.open(); }
  [[nodiscard]] bool is_open() const noexcept { return suspension_.is_open(); }

  /// From now on only control causes and the alarm are served: what waits for a callback and what
  /// still comes is `dropped{inactive}`, except for the last messages of latched topics, which go
  /// on waiting. Views go on. Cancels all timers.
  void suspend() noexcept;
  /// As `suspend`, but nothing is dropped: all goes on waiting, as far as its queue has room.
  void suspend_keeping() noexcept;
  /// Drops what came until now, unless it is kept, and serves again.
  void resume() noexcept;
  [[nodiscard]] bool is_suspended() const noexcept { return suspension_.is_suspended(); }
  /// Drops what waits for callbacks as inactive, latched messages too.
  void drop_waiting() noexcept;

  /// Whether what `armed_due_ns` says is served when it is due.
  [[nodiscard]] bool is_ticking() const noexcept { return !suspension_.is_closed(); }

  /// While suspended: calls `action` once, at `due`, as an activation of the life cycle.
  void set_alarm(Time due, std::function<void()> action) {
    suspension_.set_alarm(due, std::move(action));
  }
  void cancel_alarm() noexcept { suspension_.cancel_alarm(); }

  /// While suspended: timers may be armed, for it is resumed next. Without it they stay as they
  /// are.
  void set_resuming(bool is_resuming) noexcept { suspension_.is_resuming = is_resuming; }

  /// Arms all periodic timers, as of `start`.
  void start_timers(Time start);
  void cancel_timers() noexcept;
  /// Forgets all timers: what a restarted component declares again.
  void clear_timers() noexcept;

  /// Destroys all callbacks, once nothing is served any more: they may own handles of this very
  /// component. Outside of activations.
  void release_callbacks() noexcept;

  /// Closes all subscriptions: what waits and still comes is dropped for `reason`. After a fault
  /// those that outlive it stay open.
  void close(DropReason reason) noexcept { subscriptions.close(reason); }

  CallbackSubscription& subscribe(Topic& topic, const SubscriberOptions& options,
                                  EnvelopeCallback callback);
  /// As `subscribe`, in the place of an ended subscription of that topic, if there is one: a
  /// component that subscribes again and again keeps one ledger.
  CallbackSubscription& subscribe_again(Topic& topic, const SubscriberOptions& options,
                                        EnvelopeCallback callback);
  void end(CallbackSubscription& subscription,
           DropReason reason = DropReason::kUnsubscribed) noexcept {
    subscriptions.end(subscription, reason);
  }
  /// Calls `callback` with messages of `topics` that belong together; `queues` says, for each
  /// topic, how many messages may wait before that.
  Synchronizer& synchronize(std::span<Topic* const> topics,
                            std::span<const SubscriberOptions> queues,
                            const SynchronizerOptions& options, EnvelopeSetCallback callback) {
    return subscriptions.synchronize(topics, queues, options, std::move(callback));
  }
  /// Lets go of all that synchronizers hold: it counts as dropped for `reason`.
  void drop_held(DropReason reason) noexcept { subscriptions.drop_held(reason); }
  TimerCore& add_timer(const TimerOptions& options, TickCallback callback, TimerRole role = {}) {
    return timers_.add(*this, options, std::move(callback), std::move(role));
  }
  /// In the order in which they were added; before the start, and after the end.
  [[nodiscard]] const std::vector<std::unique_ptr<TimerCore>>& timers() const noexcept {
    return timers_.all();
  }
  /// Of all timers that it ever had, but watches, in the order in which they were added.
  /// @threads Safe; what it returns lives as long as the component.
  [[nodiscard]] std::vector<const TimerStatistics*> timer_statistics() const {
    return timers_.statistics();
  }
  /// A timer that looks after `watch`, which must outlive it; from now on in an activation, else
  /// from the start of the timers on.
  TimerCore& add_watch(Watch& watch);
  /// Looks after the quality of service of `subscription`, if it asks for one.
  void watch(CallbackSubscription& subscription);
  void arm(TimerCore& timer, Time due) noexcept;
  /// Calls `callback`, by cause event, when credits of `publisher` that had run out are there
  /// again.
  void on_credits(PublisherCore& publisher, std::function<void()> callback) {
    timers_.add_credit_event(*this, publisher, std::move(callback));
  }

  /// Asks the world whether the component has nothing to do: for the end of a run.
  [[nodiscard]] bool is_quiet() const noexcept { return inbox.is_quiet(); }

  /// When the next timer is due, as `TimerWatch` says it.
  [[nodiscard]] std::int64_t armed_due_ns() const noexcept { return due_time_.get(); }
  /// Takes a due timer's word for it: true once for each time that it was armed.
  bool take_due(std::int64_t due_ns) noexcept { return due_time_.take(due_ns); }

  TimerWatch* timer_watch = nullptr;  ///< Constant once the application is built.

  /// Forgets what was heard, with the object that heard it.
  void forget_held() noexcept { held_.clear(); }

  /// How many roots latency chains have; before it subscribes to anything.
  void set_root_count(std::size_t count);
  [[nodiscard]] std::size_t root_count() const noexcept { return held_.root_count(); }

 protected:
  /// A callback threw `what`; called in the same turn, after the activation ended.
  virtual void on_fault(std::string_view what) = 0;

  /// A watch has something to tell, before its callback is called. In a turn, but in no activation.
  virtual void on_qos_event([[maybe_unused]] const Watch& watch,
                            [[maybe_unused]] const QosEvent& event) {}

  /// A message came too late for the chain at this place of the application file, and is delivered
  /// next, or dropped. In a turn, but in no activation.
  virtual void on_breach([[maybe_unused]] std::size_t chain) {}

 private:
  /// Whether there was something to serve.
  enum class Served : std::uint8_t {
    kOne,      ///< An activation.
    kNone,     ///< Nothing is left.
    kDropped,  ///< A message that is not delivered, or was gone.
  };

  /// The next control cause that others posted; false if there is none.
  bool run_posted(ActivationRing& ring);
  /// While suspended: serves one message of what outlives that; false if there is none.
  bool serve_outliving(ActivationRing& ring);
  /// What a suspended component does; true if there may be more at once.
  bool serve_suspended(ActivationRing& ring);
  /// The next cause of an open component; false if there is none.
  bool run_next(ActivationRing& ring);
  /// One cause of this component, whatever its state; false if there is none.
  bool serve(ActivationRing& ring);
  /// Ends a turn before everything was served.
  void end_turn_early() noexcept;
  /// Looks whether `timer`'s watch has something to tell.
  void look(ActivationRing& ring, TimerCore& timer);
  /// Judges what `peek` found; `kOne` if an event was told, `kNone` if it is to be delivered.
  Served judge(ActivationRing& ring, const Inbox::Head& head);
  void tell_breaches(const Subscription& subscription, std::uint32_t breached);
  /// Serves what `peek` found.
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

#include "executor/actor.h"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "base/floating_point.h"
#include "broker/chain_end.h"
#include "broker/topic.h"
#include "executor/life_step.h"

namespace fastcycle::detail {
namespace {

constexpr int kTurnActivations = 16;
constexpr std::int64_t kTurnNs = 1'000'000;

}  // namespace

Actor::Actor(std::string its_name, std::uint32_t its_index, const base::Clock& its_clock)
    : ActorBase(std::move(its_name), its_index, its_clock),
      suspension_(inbox, [this](auto credit) { credits_.give_back(std::move(credit)); }),
      activator_(*this, turn_, held_, subscriptions, credits_,
                 [this](std::string_view what) { on_fault(what); }),
      subscriptions(*this, held_, credits_,
                    [this](const Subscription& subscription, std::uint32_t breached) {
                      report_breaches(subscription, breached);
                    }) {
  if (clock.is_simulated()) {
    publishing.stage = &stage_;
  }
}

Actor::~Actor() = default;

void Actor::post(Cause cause, std::function<void()> body, Actor* from, std::uint64_t key) {
  if (from != nullptr && clock.is_simulated()) {
    from->stage([this, cause, body = std::move(body), key] { post(cause, body, nullptr, key); });
    return;
  }
  post_and_notify(cause, std::move(body), {}, key);
}

void Actor::post_own(Cause cause, std::function<void()> body) {
  const std::uint64_t activation = running_activation.number.load(std::memory_order_relaxed);
  if (std::exchange(posted_own_in_, activation) != activation) {
    posted_own_ = 0;
  }
  const auto call = [count = ++posted_own_] { return fmt::format("own answer {}", count); };
  if (clock.is_simulated()) {
    if (publishing.replayed != nullptr) {
      if (const auto why = publishing.replayed_refusal(call())) {
        throw std::runtime_error(*why);
      }
    }
    post(cause, std::move(body), this);
    return;
  }
  const std::int64_t posted_ns = base::to_ns(publishing.now);
  if (!controls_.post_own({.cause = cause, .body = std::move(body), .posted_ns = posted_ns})) {
    const std::string why = fmt::format(
        "component \"{}\" has {} answers to itself waiting, and no more may: a callback "
        "that calls again and again must wait for a reply between its calls",
        name, ControlQueue::kMaxOwn);
    publishing.refused(call(), why);
    throw std::runtime_error(why);
  }
}

void Actor::post_and_notify(Cause cause, std::function<void()> body, std::function<void()> finished,
                            std::uint64_t key) {
  controls_.post(
      {.cause = cause, .body = std::move(body), .finished = std::move(finished), .key = key});
  inbox.mark_control();
  inbox.queue().wake();
}

void Actor::release_callbacks() noexcept {
  clear_timers();
  subscriptions.destroy_callbacks();
}

void Actor::set_root_count(std::size_t count) {
  held_.set_root_count(count);
  publishing.held_trails = held_.trails();
}

bool Actor::run_posted(ActivationRing& ring) {
  Control control;
  if (!controls_.take_posted(control)) {
    return false;
  }
  activator_.run(ring, control);
  return true;
}

void Actor::suspend() noexcept {
  cancel_timers();
  drop_held(DropReason::kInactive);
  suspension_.suspend();
}

void Actor::suspend_keeping() noexcept {
  cancel_timers();
  suspension_.suspend_keeping();
}

void Actor::resume() noexcept {
  suspension_.resume();
  inbox.mark(Inbox::kTimerBit);  // Credits may have come.
}

void Actor::drop_waiting() noexcept {
  inbox.mark_all();
  suspension_.drop_waiting(true);
}

bool Actor::serve_outliving(ActivationRing& ring) {
  Inbox::Head head;
  while (subscriptions.peek_outliving(head)) {
    if (take(ring, head) == Served::kOne) {
      return true;
    }
  }
  return false;
}

bool Actor::serve_suspended(ActivationRing& ring) {
  inbox.take_bit(Inbox::kTimerBit);
  suspension_.drop_waiting(false);
  if (serve_outliving(ring)) {
    return true;
  }
  if (suspension_.alarm_ns() > turn_.now_ns()) {
    return false;
  }
  activator_.run(ring, Control{.cause = Cause::kMode,
                               .body = suspension_.take_alarm(),
                               .key = to_key(LifeStep::kAlarm)});
  return true;
}

void Actor::look(ActivationRing& ring, TimerCore& timer) {
  const Watch& watch = *timer.watch;
  const auto event = timer.watch->look(turn_.now_ns());
  timers_.look_again(timer);  // Before the callback, which may end the subscription.
  if (event) {
    on_qos_event(watch, *event);
    activator_.run(ring, watch, *event);
  }
}

void Actor::report_breaches(const Subscription& subscription, std::uint32_t breached) {
  for (; breached != 0; breached &= breached - 1) {
    const auto place = static_cast<unsigned>(std::countr_zero(breached));
    on_breach(subscription.chain_end->chains()[place]->rule.chain);
  }
}

Actor::Served Actor::judge(ActivationRing& ring, const Inbox::Head& head) {
  using Decision = DeliveryFilter::Decision;
  const Subscription& subscription = head.lane->subscription;
  const Time now = std::max(base::from_ns(turn_.now_ns()), base::from_ns(head.head.time_ns));
  const auto verdict = DeliveryFilter::take(head, now);
  report_breaches(subscription, verdict.breached);
  if (verdict.decision == Decision::kDeliver) {
    return Served::kNone;
  }
  if (verdict.decision == Decision::kDrop) {
    release(head.head.envelope);
    if (head.lane->credit != nullptr) {
      credits_.give_back(head.lane->credit);
    }
  }
  if (!verdict.event) {
    return Served::kDropped;
  }
  activator_.run(ring, *subscription.quality, *verdict.event);
  return Served::kOne;
}

bool Actor::run_next(ActivationRing& ring) {
  Inbox::Head head;
  const bool has_message = inbox.peek(head);
  if (has_message && controls_.has_posted()) {
    return run_posted(ring);  // Perhaps posted before this message was published.
  }
  if (has_message && !timers_.is_empty() && !clock.is_simulated()) {
    // It may have come after the clock was read, and after a timer that was due meanwhile.
    turn_.pass(base::from_ns(head.head.time_ns));
  }
  std::int64_t before_ns = has_message ? head.head.time_ns : base::kNever;
  const bool has_own = controls_.has_own() && controls_.next_own_ns() < before_ns;
  if (has_own) {
    before_ns = controls_.next_own_ns();
  }
  TimerCore* timer = timers_.due(turn_.now_ns());
  // In simulated time the ticks of a round come first.
  if (timer != nullptr && (clock.is_simulated() || timer->due_ns <= before_ns)) {
    if (timer->watch != nullptr) {
      look(ring, *timer);
    } else {
      activator_.run(ring, *timer, timers_.take(*timer, turn_.now_ns()));
    }
    return true;
  }
  if (has_own) {
    activator_.run(ring, controls_.take_own());
    return true;
  }
  if (!has_message) {
    return false;
  }
  // The rest is checked again: a callback may have suspended the component.
  take(ring, head);
  return true;
}

Actor::Served Actor::take(ActivationRing& ring, const Inbox::Head& head) {
  if (head.lane->options.is_judged) {
    if (const Served served = judge(ring, head); served != Served::kNone) {
      return served;
    }
  } else if (!Inbox::pop(head)) {
    return Served::kDropped;
  }
  if (head.lane->is_closed()) {
    // Its publisher saw the end too late, and has not taken it back yet.
    head.lane->drained.add();
    release(head.head.envelope);
    return Served::kDropped;
  }
  if (head.lane->credit == nullptr) {
    activator_.run(ring, head);
  } else {
    credits_.begin(head.lane->credit);  // The callback may end the subscription, and its lane.
    activator_.run(ring, head);
    credits_.finish();
  }
  return Served::kOne;
}

bool Actor::run_early(ActivationRing& ring, std::int64_t now_ns) {
  Inbox::Head head;
  if (script_ != nullptr || !inbox.peek_early(head) || !is_open() || controls_.has_posted() ||
      controls_.has_own()) {
    return false;
  }
  if (head.lane->options.is_judged) {
    return false;  // In a turn, where more than one thing may come of it.
  }
  turn_.set(now_ns);
  if (!timers_.is_empty()) {
    turn_.pass(base::from_ns(head.head.time_ns));
    if (timers_.due(turn_.now_ns()) != nullptr) {
      return false;  // A turn puts them in order.
    }
  }
  base::reset_floating_point();
  timers_.begin_turn();
  if (take(ring, head) != Served::kOne) {
    return false;
  }
  if (controls_.has_own()) {
    inbox.mark_control();
  }
  publish_due();
  return true;
}

[[gnu::always_inline]] inline bool Actor::serve(ActivationRing& ring) {
  // The bit first: what is posted after the look sets it again.
  inbox.take_bit(Inbox::kControlBit);
  if (script_ != nullptr) [[unlikely]] {
    inbox.take_bit(Inbox::kTimerBit);
    return script_->serve(ring);
  }
  if (controls_.has_posted() && run_posted(ring)) {
    return true;
  }
  if (is_open()) {
    if (inbox.take_bit(Inbox::kTimerBit)) {
      timers_.take_credits(turn_.now_ns());
    }
    return run_next(ring);
  }
  if (controls_.has_own()) {
    activator_.run(ring, controls_.take_own());
    return true;
  }
  return is_suspended() && serve_suspended(ring);
}

void Actor::end_turn_early() noexcept {
  if (controls_.has_posted() || controls_.has_own()) {
    inbox.keep_control();
  }
  inbox.end_early();
}

void Actor::run_turn(ActivationRing& ring) {
  if (!inbox.begin()) {
    return;
  }
  base::reset_floating_point();
  timers_.begin_turn();
  turn_.read();
  const std::int64_t turn_began = turn_.read_ns();
  for (int count = 0;; ++count) {
    if (count >= kTurnActivations || turn_.read_ns() - turn_began > kTurnNs) {
      publish_due();
      end_turn_early();
      return;
    }
    if (serve(ring)) {
      continue;
    }
    publish_due();
    if (is_ticking() && script_ == nullptr ? inbox.try_end_idle() : inbox.try_end_unopened()) {
      return;
    }
    turn_.read();
  }
}

void Actor::run_round(ActivationRing& ring) {
  if (!inbox.begin()) {
    return;
  }
  base::reset_floating_point();
  timers_.begin_turn();
  turn_.read();
  for (;;) {
    if (serve(ring)) {
      continue;
    }
    publish_due();
    if (is_ticking() ? inbox.try_end_idle() : inbox.try_end_unopened()) {
      return;
    }
  }
}

// ---- A recorded run, executed again ----

void Actor::repeat_next(std::uint64_t number, ReplayedReads& replayed) noexcept {
  activator_.set_next(number);
  publishing.replayed = &replayed;
  base::reset_floating_point();
  timers_.begin_turn();
  turn_.read();
}

void Actor::repeat_view(View& view, const Lane& lane, Envelope* envelope) {
  if (lane.options.ages) {
    held_.hold(view, *envelope);
  }
  view.insert(envelope);
}

void Actor::repeat(ActivationRing& ring, const Inbox::Head& head) {
  if (head.lane->credit == nullptr) {
    activator_.run(ring, head);
    return;
  }
  credits_.begin(head.lane->credit);
  activator_.run(ring, head);
  credits_.finish();
}

void Actor::repeat(ActivationRing& ring, TimerCore& timer, const Tick& tick) {
  timer.due_ns = timer.is_periodic() ? base::to_ns(tick.due + timer.options.period) : base::kNever;
  activator_.run(ring, timer, tick);
}

void Actor::repeat(ActivationRing& ring, const Watch& watch, const QosEvent& event) {
  activator_.run(ring, watch, event);
}

void Actor::repeat(ActivationRing& ring, const Control& control) {
  activator_.run(ring, control);
}

bool Actor::repeat_posted(ActivationRing& ring, Cause cause, std::uint64_t key) {
  Control control;
  if (!controls_.take_posted(cause, key, control)) {
    return false;
  }
  activator_.run(ring, control);
  return true;
}

bool Actor::repeat_alarm(ActivationRing& ring) {
  if (!suspension_.has_alarm()) {
    return false;
  }
  activator_.run(ring, Control{.cause = Cause::kMode,
                               .body = suspension_.take_alarm(),
                               .key = to_key(LifeStep::kAlarm)});
  return true;
}

bool Actor::repeat_own(ActivationRing& ring) {
  if (!controls_.has_own()) {
    return false;
  }
  activator_.run(ring, controls_.take_own());
  return true;
}

// ---- Of one that follows another ----

bool Actor::drop_posted(Control& dropped) {
  if (!controls_.take_posted(dropped)) {
    return false;
  }
  if (dropped.finished) {
    dropped.finished();
  }
  return true;
}

void Actor::follow(Script& script) noexcept {
  script_ = &script;
  subscriptions.follow(true);
}

void Actor::stop_following() noexcept {
  script_ = nullptr;
  subscriptions.follow(false);
  publishing.replayed = nullptr;
  turn_.let_go();
  inbox.mark_all();
  inbox.mark_control();
  inbox.mark(Inbox::kTimerBit);
}

void Actor::start_timers(Time start) {
  for (CallbackSubscription* subscription : subscriptions.callbacks()) {
    if (subscription->quality == nullptr || subscription->is_ended) {
      continue;
    }
    subscription->quality->forget_gaps();
    if (subscription->quality->timer == nullptr) {
      watch(*subscription);
    }
  }
  timers_.start(start);
}

void Actor::cancel_timers() noexcept {
  timers_.cancel();
}

void Actor::clear_timers() noexcept {
  for (CallbackSubscription* subscription : subscriptions.callbacks()) {
    if (subscription->quality != nullptr) {
      subscription->quality->timer = nullptr;
    }
  }
  timers_.clear();
}

void Actor::publish_due() noexcept {
  std::int64_t due_ns = script_ == nullptr ? suspension_.alarm_ns() : base::kNever;
  if (!is_suspended() && script_ == nullptr) {
    due_ns = std::min(due_ns, timers_.next_due_ns());
  }
  if (due_ns != base::kNever && !clock.is_simulated()) {
    due_ns = clock.monotonic_at(base::from_ns(due_ns));
  }
  due_time_.set(due_ns, timer_watch);
}

CallbackSubscription& Actor::subscribe(Topic& topic, const SubscriberOptions& options,
                                       EnvelopeCallback callback) {
  CallbackSubscription& result = subscriptions.add(topic, options, std::move(callback));
  watch(result);
  return result;
}

CallbackSubscription& Actor::subscribe_again(Topic& topic, const SubscriberOptions& options,
                                             EnvelopeCallback callback) {
  CallbackSubscription& result = subscriptions.add_again(topic, options, std::move(callback));
  watch(result);
  return result;
}

TimerCore& Actor::add_watch(Watch& its_watch) {
  return timers_.add_watch(
      *this, its_watch, publishing.is_in_activation() ? base::to_ns(publishing.now) : base::kNever);
}

void Actor::watch(CallbackSubscription& subscription) {
  Quality* quality = subscription.quality.get();
  if (quality == nullptr || !quality->is_timed()) {
    return;
  }
  if (quality->timer == nullptr) {
    quality->timer = &add_watch(*quality);
  } else {
    quality->begin(base::to_ns(publishing.now));
    quality->timer->due_ns = quality->next_look_ns();
  }
}

void Actor::arm(TimerCore& timer, Time due) noexcept {
  if (is_suspended() && !suspension_.is_resuming) {
    return;  // It would tick as soon as the component is active again.
  }
  timers_.arm(timer, std::max(base::to_ns(due), base::to_ns(publishing.now)));
}

}  // namespace fastcycle::detail

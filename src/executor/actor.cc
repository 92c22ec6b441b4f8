#include "executor/actor.h"

#include <algorithm>
#include <bit>
#include <exception>
#include <utility>

#include <fmt/format.h>

#include "base/floating_point.h"
#include "broker/topics.h"
#include "executor/synchronizer.h"

namespace fastcycle::detail {
namespace {

constexpr int kTurnActivations = 16;
constexpr std::int64_t kTurnNs = 1'000'000;

SubscriberOptions view_options(std::size_t depth, std::optional<Duration> lifespan) {
  return {.depth = depth, .overflow = Overflow::kDropOldest, .keep = depth, .lifespan = lifespan};
}

}  // namespace

CallbackSubscription::CallbackSubscription(Topic& its_topic, Actor& its_actor,
                                           const SubscriberOptions& options,
                                           EnvelopeCallback its_callback, Kind its_kind)
    : Subscription(its_topic, its_actor.inbox, its_actor.name, its_kind, options),
      actor(its_actor),
      callback(std::make_unique<EnvelopeCallback>(std::move(its_callback))) {}

View::View(Topic& its_topic, Actor& its_actor, Kind its_kind, std::size_t its_depth,
           std::optional<Duration> its_span, std::optional<Duration> its_lifespan)
    : Subscription(its_topic, its_actor.inbox, its_actor.name, its_kind,
                   view_options(its_depth, its_lifespan)),
      actor(its_actor),
      span(its_span) {
  held.reserve(depth + 1);
}

View::~View() {
  clear();
}

void View::insert(Envelope* envelope) {
  const auto place = std::upper_bound(held.begin(), held.end(), envelope,
                                      [](const Envelope* a, const Envelope* b) {
                                        return a->info.publish_time != b->info.publish_time
                                                   ? a->info.publish_time < b->info.publish_time
                                                   : a->info.publisher < b->info.publisher;
                                      });
  held.insert(place, envelope);
  if (held.size() > depth) {
    release(held.front());
    held.erase(held.begin());
  }
}

void View::forget_old(Time now) noexcept {
  const auto is_old = [&](const Envelope& envelope) {
    const Time published = envelope.info.publish_time;
    return (span && published < now - *span) ||
           (quality != nullptr && quality->is_expired(base::to_ns(published), base::to_ns(now)));
  };
  while (!held.empty() && is_old(*held.front())) {
    release(held.front());
    held.erase(held.begin());
  }
}

void View::clear() noexcept {
  for (Envelope* envelope : held) {
    release(envelope);
  }
  held.clear();
}

Actor::Actor(std::string its_name, std::uint32_t its_index, const base::Clock& its_clock)
    : name(std::move(its_name)), index(its_index), clock(its_clock), stage_(*this) {
  publishing.name = name;
  publishing.clock = &clock;
  if (clock.is_simulated()) {
    publishing.stage = &stage_;
  }
}

Actor::~Actor() = default;

void Actor::post(Cause cause, std::function<void()> body, Actor* from) {
  if (from != nullptr && clock.is_simulated()) {
    from->stage([this, cause, body = std::move(body)] { post(cause, body); });
    return;
  }
  put_in_front({cause, std::move(body)});
}

void Actor::post_and_tell(Cause cause, std::function<void()> body, std::function<void()> finished) {
  put_in_front({cause, std::move(body), std::move(finished)});
}

void Actor::put_in_front(Control control) {
  {
    const std::lock_guard lock(control_mutex_);
    controls_.push_back(std::move(control));
    has_controls_.store(true, std::memory_order_seq_cst);
  }
  inbox.mark_control();
  inbox.queue().wake();
}

template <typename Body, typename Where>
void Actor::activate(ActivationRing& ring, ActivationRecord record, const Origin& origin,
                     base::CoarseHistogram* run_time, const Body& body, const Where& where) {
  const std::int64_t begin_ns = read_ns_;
  publishing.now = std::max(base::from_ns(record.time_ns), publishing.now);
  publishing.origin = &origin;
  publishing.publish_count = 0;
  publishing.is_in_activation = true;
  if (!views.empty()) {
    refresh_views();
  }
  record.component = index;
  record.number = ++number_;
  record.time_ns = base::to_ns(publishing.now);
  record.begin_ns = begin_ns;
  const std::uint64_t place = ring.begin(record);
  record.outcome = Outcome::kDone;
  try {
    body();
  } catch (const std::exception& exception) {
    record.outcome = Outcome::kFault;
    fault_ = where() + exception.what();
  } catch (...) {
    record.outcome = Outcome::kFault;
    fault_ = where() + "something that is no std::exception";
  }
  read_ns_ = std::max(begin_ns, base::monotonic_ns());
  record.duration_ns = read_ns_ - begin_ns;
  record.publish_count = publishing.publish_count;
  record.published_ns = record.publish_count == 0 ? 0 : base::to_ns(publishing.published);
  statistics.activations.add();
  statistics.callback.record(record.duration_ns);
  if (run_time != nullptr) {
    run_time->record(record.duration_ns);
  }
  ring.end(place, record);
  if (publishing.has_leftovers) {
    finish_leftovers();
  }
  if (record.outcome == Outcome::kFault) {
    statistics.faults.add();
    on_fault(fault_);
    if (publishing.has_leftovers) {
      finish_leftovers();  // Of a start anew.
    }
    read_ns_ = base::monotonic_ns();  // A restart takes long.
  }
  publishing.is_in_activation = false;
  publishing.origin = &PublishingComponent::kNoOrigin;
  publishing.trails = nullptr;
}

void Actor::finish_leftovers() noexcept {
  publishing.has_leftovers = false;
  dying_.clear();
  for (PublisherCore* publisher : publishing.asked) {
    if (!publisher->end_asking()) {
      continue;
    }
    if (clock.is_simulated()) {
      stage([publisher] { publisher->await_credits(); });
    } else {
      publisher->await_credits();
    }
  }
  publishing.asked.clear();
}

void Actor::on_credits(PublisherCore& publisher, std::function<void()> callback) {
  TimerCore& timer =
      add_timer({}, [callback = std::move(callback)](const Tick&) { callback(); },
                {.name = publisher.topic.name,
                 .label = "its callback for credits of \"" + publisher.topic.name + "\"",
                 .cause = Cause::kEvent});
  credit_events_.push_back({&publisher, &timer});
}

void Actor::take_credit_events() noexcept {
  for (const CreditEvent& event : credit_events_) {
    if (event.publisher->take_returned_credits() && are_timers_on_) {
      event.timer->due_ns = base::to_ns(clock.at_monotonic(read_ns_));
    }
  }
}

void Actor::give_back(std::shared_ptr<LaneCredit> credit) {
  if (clock.is_simulated()) {
    stage([credit = std::move(credit)] { credit->finish(); });
  } else {
    credit->finish();
  }
}

void Actor::end_credits(const Subscription& subscription) noexcept {
  for (auto& credit : subscription.credits()) {
    if (clock.is_simulated() && publishing.is_in_activation) {
      stage([credit = std::move(credit)] { credit->end(); });
    } else {
      credit->end();
    }
  }
}

void Actor::refresh_views() {
  for (const auto& lane : inbox.views()) {
    auto& view = static_cast<View&>(lane->subscription);
    Lane::Head head;
    while (lane->peek(head)) {
      if (lane->pop(head)) {
        if (view.quality != nullptr &&
            view.quality->is_expired(head.time_ns, base::to_ns(publishing.now))) {
          view.quality->expired.add();
          release(head.envelope);
          continue;
        }
        const Time now = std::max(publishing.now, base::from_ns(head.time_ns));
        if (view.chain_end != nullptr && !judge_chains(view, *head.envelope, now)) {
          release(head.envelope);
          continue;
        }
        lane->delivered.add();
        if (lane->options.ages) {
          hold(*head.envelope);
        }
        // It may have come after the clock was read.
        publishing.now = now;
        view.insert(head.envelope);
      }
    }
  }
  for (View* view : views) {
    view->forget_old(publishing.now);
  }
}

void Actor::set_root_count(std::size_t count) {
  held_trails_.resize(count);
  publishing.held_trails = count == 0 ? nullptr : held_trails_.data();
}

void Actor::hold(const Envelope& envelope) noexcept {
  for (std::size_t root = 0; root < held_trails_.size(); ++root) {
    const Trail& trail = envelope.trails[root];
    Trail& held = held_trails_[root];
    if (trail.is_known() && (!held.is_known() || held.taken() <= trail.taken())) {
      held = trail;
    }
  }
  const Origin& origin = envelope.info.origin;
  for (std::size_t i = 0; i < held_count_; ++i) {
    if (held_[i].root == origin.root) {
      held_[i].taken = std::max(held_[i].taken, origin.taken);
      return;
    }
  }
  if (held_count_ < held_.size()) {
    held_[held_count_++] = {origin.root, origin.taken};
    return;
  }
  // More roots than places: the one heard of least recently gives way.
  *std::min_element(held_.begin(), held_.end(), [](const HeldRoot& a, const HeldRoot& b) {
    return a.taken < b.taken;
  }) = {origin.root, origin.taken};
}

Origin Actor::oldest_held() const noexcept {
  Origin oldest;
  for (std::size_t i = 0; i < held_count_; ++i) {
    if (oldest.root == 0 || held_[i].taken < oldest.taken) {
      oldest = {.taken = held_[i].taken, .root = held_[i].root, .held = true};
    }
  }
  return oldest;
}

void Actor::run_controls(ActivationRing& ring) {
  std::vector<Control> controls;
  {
    const std::lock_guard lock(control_mutex_);
    controls.swap(controls_);
    has_controls_.store(false, std::memory_order_seq_cst);
  }
  for (const Control& control : controls) {
    run_control(ring, control);
  }
}

void Actor::run_control(ActivationRing& ring, const Control& control) {
  read_ns_ = base::monotonic_ns();
  ActivationRecord record;
  record.cause = control.cause;
  record.time_ns = record.cause_ns = base::to_ns(clock.at_monotonic(read_ns_));
  activate(ring, record, oldest_held(), nullptr, control.body, [] { return std::string(); });
  if (control.finished) {
    control.finished();
  }
}

void Actor::suspend() noexcept {
  gate_.store(Gate::kSuspended, std::memory_order_relaxed);
  cancel_timers();
  drop_held(DropReason::kInactive);
  inbox.mark_all();  // What waits already goes in this turn.
}

void Actor::resume() noexcept {
  drop_inactive(false);
  cancel_alarm();
  open();
  inbox.mark_all();              // Latched messages waited without their bits.
  inbox.mark(Inbox::kTimerBit);  // Credits may have come.
}

void Actor::drop_waiting() noexcept {
  inbox.mark_all();
  drop_inactive(true);
}

void Actor::drop_inactive(bool with_latched) noexcept {
  inbox.take_ready([&](Lane& lane) {
    Subscription& subscription = lane.subscription;
    if (subscription.kind == Subscription::Kind::kCallback &&
        static_cast<CallbackSubscription&>(subscription).outlives_faults) {
      return;
    }
    const std::size_t kept = with_latched ? 0 : subscription.topic.options.latched;
    Lane::Head head;
    while (lane.queued() > kept && lane.peek(head)) {
      if (lane.pop(head)) {
        (lane.is_closed() ? lane.drained : subscription.inactive).add();
        release(head.envelope);
        if (lane.credit != nullptr) {
          give_back(lane.credit);
        }
      }
    }
  });
}

bool Actor::serve_outliving(ActivationRing& ring) {
  for (CallbackSubscription* subscription : callbacks) {
    if (!subscription->outlives_faults) {
      continue;
    }
    for (const auto& lane : subscription->lanes()) {
      Inbox::Head head;
      head.lane = lane.get();
      if (lane->peek(head.head) && take(ring, head)) {
        return true;
      }
    }
  }
  return false;
}

bool Actor::serve_suspended(ActivationRing& ring) {
  inbox.take_bit(Inbox::kTimerBit);
  drop_inactive(false);
  if (serve_outliving(ring)) {
    return true;
  }
  if (alarm_ns_ > base::to_ns(clock.at_monotonic(read_ns_))) {
    return false;
  }
  alarm_ns_ = base::kNever;
  run_control(ring, {.cause = Cause::kMode, .body = std::exchange(alarm_, nullptr)});
  return true;
}

void Actor::set_alarm(Time due, std::function<void()> action) {
  alarm_ns_ = base::to_ns(due);
  alarm_ = std::move(action);
}

void Actor::cancel_alarm() noexcept {
  alarm_ns_ = base::kNever;
}

TimerCore* Actor::due_timer(std::int64_t now_ns) noexcept {
  TimerCore* earliest = nullptr;
  for (const auto& timer : timers_) {
    if (timer->due_ns > now_ns || (clock.is_simulated() && timer->armed_in_turn == turn_)) {
      continue;
    }
    if (earliest == nullptr || timer->due_ns < earliest->due_ns) {
      earliest = timer.get();
    }
  }
  return earliest;
}

void Actor::tick(ActivationRing& ring, TimerCore& timer) {
  const std::int64_t now_ns = base::to_ns(clock.at_monotonic(read_ns_));
  const std::int64_t late_ns = now_ns - timer.due_ns;
  Tick tick{.due = base::from_ns(timer.due_ns)};
  if (timer.is_periodic()) {
    // What is a whole period late replaces the ticks that it missed.
    tick.skipped = static_cast<std::uint64_t>(late_ns / timer.options.period.count());
    tick.due += timer.options.period * static_cast<std::int64_t>(tick.skipped);
    timer.due_ns = base::to_ns(tick.due + timer.options.period);
    statistics.overruns.add(tick.skipped);
  } else {
    timer.due_ns = base::kNever;
  }
  timer.armed_in_turn = turn_;
  statistics.lateness.record(now_ns - base::to_ns(tick.due));
  ActivationRecord record;
  record.cause = timer.role.cause;
  record.key = timer.number;
  record.skipped = tick.skipped;
  record.time_ns = now_ns;
  record.cause_ns = base::to_ns(tick.due);
  activate(
      ring, record, oldest_held(), &timer.statistics->run_time, [&] { timer.callback(tick); },
      [&] { return timer.role.label + " threw: "; });
}

void Actor::look(ActivationRing& ring, TimerCore& timer) {
  const Watch& its_watch = *timer.watch;
  const auto event = timer.watch->look(base::to_ns(clock.at_monotonic(read_ns_)));
  // Before the callback, which may end the subscription.
  timer.due_ns = its_watch.next_look_ns();
  timer.armed_in_turn = turn_;
  if (event) {
    tell(ring, its_watch, *event);
  }
}

void Actor::tell(ActivationRing& ring, const Watch& its_watch, const QosEvent& event) {
  const auto callback = its_watch.callback();
  if (callback == nullptr) {
    return;
  }
  ActivationRecord record;
  record.cause = Cause::kEvent;
  record.key = event.count;
  record.time_ns = record.cause_ns = base::to_ns(clock.at_monotonic(read_ns_));
  activate(
      ring, record, oldest_held(), nullptr, [&] { (*callback)(event); },
      [&] { return "its callback for events of \"" + std::string(event.topic) + "\" threw: "; });
}

bool Actor::judge(ActivationRing& ring, const Inbox::Head& head) {
  Subscription& subscription = head.lane->subscription;
  if (subscription.quality != nullptr ? !judge_quality(ring, head) : !Inbox::pop(head)) {
    return false;
  }
  if (subscription.chain_end == nullptr || head.lane->is_closed()) {
    return true;
  }
  const Time now = std::max(clock.at_monotonic(read_ns_), base::from_ns(head.head.time_ns));
  if (judge_chains(subscription, *head.head.envelope, now)) {
    return true;
  }
  release(head.head.envelope);
  if (head.lane->credit != nullptr) {
    give_back(head.lane->credit);
  }
  return false;
}

bool Actor::judge_chains(Subscription& subscription, const Envelope& envelope, Time now) {
  const ChainEnd& end = *subscription.chain_end;
  const ChainEnd::Verdict verdict = subscription.chain_end->judge(envelope.trails, now);
  for (std::uint32_t left = verdict.breached; left != 0; left &= left - 1) {
    on_breach(end.chains()[static_cast<unsigned>(std::countr_zero(left))]->rule.chain);
  }
  return !verdict.is_dropped;
}

bool Actor::judge_quality(ActivationRing& ring, const Inbox::Head& head) {
  Quality& quality = *head.lane->subscription.quality;
  const Time now = std::max(clock.at_monotonic(read_ns_), base::from_ns(head.head.time_ns));
  QosEvent event;
  const auto verdict = quality.judge(*head.lane, head.head, base::to_ns(now), event);
  if (verdict == Quality::Verdict::kTell) {
    tell(ring, quality, event);
    return false;
  }
  if (!Inbox::pop(head)) {
    return false;
  }
  quality.took(*head.lane, head.head);
  if (verdict == Quality::Verdict::kDeliver || head.lane->is_closed()) {
    return true;
  }
  quality.expired.add();
  release(head.head.envelope);
  if (head.lane->credit != nullptr) {
    give_back(head.lane->credit);
  }
  tell(ring, quality, event);
  return false;
}

void Actor::deliver(ActivationRing& ring, const Inbox::Head& head) {
  Lane& lane = *head.lane;
  Envelope& envelope = *head.head.envelope;
  auto& subscription = static_cast<CallbackSubscription&>(lane.subscription);
  const bool ages = lane.options.ages;  // The callback may end the subscription, and its lane.
  const Time published = base::from_ns(head.head.time_ns);
  Time now = clock.at_monotonic(read_ns_);
  if (now < published && !clock.is_simulated()) {
    now = published;  // It came after the clock was read.
    read_ns_ = std::max(read_ns_, clock.monotonic_at(published));
  }
  lane.delivered.add();
  ActivationRecord record;
  const bool is_input = lane.options.is_external && subscription.cause == Cause::kMessage;
  record.cause = is_input ? Cause::kExternal : subscription.cause;
  record.publisher = lane.publisher;
  record.key = head.head.sequence;
  record.time_ns = base::to_ns(now);
  record.cause_ns = head.head.time_ns;
  if (root_count() != 0) [[unlikely]] {
    publishing.trails = envelope.trails;
  }
  activate(
      ring, record, envelope.info.origin, &subscription.run_time,
      [&] { (*subscription.callback)(envelope, *head.head.payload); },
      [&] { return "its callback for \"" + subscription.topic.name + "\" threw: "; });
  // The callback must not wait for what only statistics and later timers need.
  subscription.latency.record((now - published).count());
  if (ages) {
    hold(envelope);
  }
  release(&envelope);
}

bool Actor::run_next(ActivationRing& ring) {
  for (;;) {
    Inbox::Head head;
    const bool has_message = inbox.peek(head);
    if (has_message && has_controls_.load(std::memory_order_seq_cst)) {
      // Posted after their bit was looked at, and perhaps before this message was published.
      run_controls(ring);
      if (!is_open()) {
        return false;
      }
      continue;
    }
    if (has_message && !timers_.empty() && !clock.is_simulated()) {
      // It may have come after the clock was read, and after a timer that was due meanwhile.
      read_ns_ = std::max(read_ns_, clock.monotonic_at(base::from_ns(head.head.time_ns)));
    }
    TimerCore* timer = due_timer(base::to_ns(clock.at_monotonic(read_ns_)));
    // In simulated time the ticks of a round come first.
    if (timer != nullptr &&
        (!has_message || clock.is_simulated() || timer->due_ns <= head.head.time_ns)) {
      timer->watch == nullptr ? tick(ring, *timer) : look(ring, *timer);
      return true;
    }
    if (!has_message) {
      return false;
    }
    if (take(ring, head)) {
      return true;
    }
  }
}

bool Actor::take(ActivationRing& ring, const Inbox::Head& head) {
  if (head.lane->options.is_judged ? !judge(ring, head) : !Inbox::pop(head)) {
    return false;
  }
  if (head.lane->is_closed()) {
    // Its publisher saw the end too late, and has not taken it back yet.
    head.lane->drained.add();
    release(head.head.envelope);
    return false;
  }
  if (head.lane->credit == nullptr) {
    deliver(ring, head);
  } else {
    auto credit = head.lane->credit;  // The callback may end the subscription, and its lane.
    deliver(ring, head);
    give_back(std::move(credit));
  }
  return true;
}

bool Actor::run_early(ActivationRing& ring, std::int64_t now_ns) {
  Inbox::Head head;
  if (!inbox.peek_early(head) || !is_open() || has_controls_.load(std::memory_order_seq_cst)) {
    return false;
  }
  if (head.lane->options.is_judged) {
    return false;  // In a turn, where more than one thing may come of it.
  }
  read_ns_ = now_ns;
  if (!timers_.empty()) {
    read_ns_ = std::max(read_ns_, clock.monotonic_at(base::from_ns(head.head.time_ns)));
    if (due_timer(base::to_ns(clock.at_monotonic(read_ns_))) != nullptr) {
      return false;  // A turn puts them in order.
    }
  }
  base::reset_floating_point();
  ++turn_;
  if (!take(ring, head)) {
    return false;
  }
  publish_due();
  return true;
}

void Actor::run_turn(ActivationRing& ring) {
  if (!inbox.begin()) {
    return;
  }
  base::reset_floating_point();
  ++turn_;
  read_ns_ = base::monotonic_ns();
  const std::int64_t turn_began = read_ns_;
  int count = 0;
  for (;;) {
    if (inbox.take_bit(Inbox::kControlBit)) {
      run_controls(ring);
      continue;
    }
    if (!is_open()) {
      const bool is_to_be_emptied = is_suspended();
      if (is_to_be_emptied && serve_suspended(ring)) {
        continue;
      }
      publish_due();
      if (is_to_be_emptied ? inbox.try_end_idle() : inbox.try_end_unopened()) {
        return;
      }
      read_ns_ = base::monotonic_ns();
      continue;
    }
    if (count == kTurnActivations || read_ns_ - turn_began > kTurnNs) {
      publish_due();
      inbox.end_early();
      return;
    }
    if (inbox.take_bit(Inbox::kTimerBit)) {
      take_credit_events();
    }
    if (run_next(ring)) {
      ++count;
      continue;
    }
    publish_due();
    if (inbox.try_end_idle()) {
      return;
    }
    read_ns_ = base::monotonic_ns();
  }
}

void Actor::run_round(ActivationRing& ring) {
  if (!inbox.begin()) {
    return;
  }
  base::reset_floating_point();
  ++turn_;
  read_ns_ = base::monotonic_ns();
  for (;;) {
    if (inbox.take_bit(Inbox::kControlBit)) {
      run_controls(ring);
      continue;
    }
    if (is_suspended()) {
      if (serve_suspended(ring)) {
        continue;
      }
    } else if (is_open()) {
      if (inbox.take_bit(Inbox::kTimerBit)) {
        take_credit_events();
      }
      if (run_next(ring)) {
        continue;
      }
    }
    publish_due();
    if (is_ticking() ? inbox.try_end_idle() : inbox.try_end_unopened()) {
      return;
    }
  }
}

void Actor::hand_over_stage() {
  std::vector<Staged> staged;
  staged.swap(staged_);
  for (Staged& entry : staged) {
    if (entry.publisher != nullptr) {
      entry.publisher->deliver(entry.envelope);
    } else {
      entry.action();
    }
  }
  staged.clear();
  staged_.swap(staged);  // Keeps its capacity.
}

void Actor::start_timers(Time start) {
  for (CallbackSubscription* subscription : callbacks) {
    if (subscription->quality == nullptr || subscription->is_ended) {
      continue;
    }
    subscription->quality->forget_gaps();
    if (subscription->quality->timer == nullptr) {
      watch(*subscription);
    }
  }
  are_timers_on_ = true;
  for (const auto& timer : timers_) {
    if (timer->is_periodic()) {
      timer->due_ns = base::to_ns(start + timer->options.phase + timer->options.period);
    } else if (timer->watch != nullptr) {
      timer->watch->begin(base::to_ns(start));
      timer->due_ns = timer->watch->next_look_ns();
    }
  }
}

void Actor::cancel_timers() noexcept {
  are_timers_on_ = false;
  for (const auto& timer : timers_) {
    timer->due_ns = base::kNever;
  }
}

void Actor::clear_timers() noexcept {
  for (CallbackSubscription* subscription : callbacks) {
    if (subscription->quality != nullptr) {
      subscription->quality->timer = nullptr;
    }
  }
  timers_.clear();
  credit_events_.clear();
  const std::lock_guard lock(timer_mutex_);
  for (TimerStatistics& its : timer_statistics_) {
    its.is_taken = false;
  }
}

void Actor::publish_due() noexcept {
  std::int64_t due_ns = alarm_ns_;
  if (!is_suspended()) {
    for (const auto& timer : timers_) {
      due_ns = std::min(due_ns, timer->due_ns);
    }
  }
  if (due_ns != base::kNever && !clock.is_simulated()) {
    due_ns = clock.monotonic_at(base::from_ns(due_ns));
  }
  if (due_ns != armed_due_ns_.load(std::memory_order_seq_cst)) {
    armed_due_ns_.store(due_ns, std::memory_order_seq_cst);
    if (due_ns != base::kNever) {
      timer_watch->timer_armed(due_ns);
    }
  }
}

void Actor::close(DropReason reason) noexcept {
  for (CallbackSubscription* subscription : callbacks) {
    if (reason != DropReason::kFault || !subscription->outlives_faults) {
      subscription->close(reason);
      end_credits(*subscription);
    }
  }
  for (View* view : views) {
    view->close(reason);
  }
  drop_held(reason);
}

void Actor::drop_held(DropReason reason) noexcept {
  for (const auto& synchronizer : synchronizers) {
    synchronizer->drop_held(reason);
  }
}

Synchronizer& Actor::synchronize(std::span<Topic* const> topics,
                                 std::span<const SubscriberOptions> queues,
                                 const SynchronizerOptions& options, EnvelopeSetCallback callback) {
  synchronizers.push_back(
      std::make_unique<Synchronizer>(*this, topics.size(), options, std::move(callback)));
  Synchronizer& synchronizer = *synchronizers.back();
  for (std::size_t i = 0; i < topics.size(); ++i) {
    auto input = std::make_unique<SynchronizerInput>(*topics[i], *this, queues[i], synchronizer, i);
    synchronizer.connect(*input);
    callbacks.push_back(input.get());
    topics[i]->subscriptions.push_back(std::move(input));
  }
  publishing.has_subscribers = true;
  return synchronizer;
}

CallbackSubscription& Actor::subscribe(Topic& topic, const SubscriberOptions& options,
                                       EnvelopeCallback callback) {
  auto subscription =
      std::make_unique<CallbackSubscription>(topic, *this, options, std::move(callback));
  CallbackSubscription& result = *subscription;
  topic.subscriptions.push_back(std::move(subscription));
  callbacks.push_back(&result);
  publishing.has_subscribers = true;
  watch(result);
  return result;
}

CallbackSubscription& Actor::subscribe_again(Topic& topic, const SubscriberOptions& options,
                                             EnvelopeCallback callback) {
  for (CallbackSubscription* old : callbacks) {
    if (old->is_ended && &old->topic == &topic &&
        old->depth == options.depth.value_or(Subscription::kDefaultDepth) &&
        old->overflow == options.overflow.value_or(Overflow::kDropOldest) &&
        old->keep == options.keep &&
        (old->quality != nullptr) == Quality::is_asked_for(topic, options)) {
      old->callback = std::make_unique<EnvelopeCallback>(std::move(callback));
      old->is_ended = false;
      old->set_history(options);
      if (old->quality != nullptr) {
        old->quality->set(options);
        watch(*old);
      }
      return *old;
    }
  }
  return subscribe(topic, options, std::move(callback));
}

void Actor::end(CallbackSubscription& subscription, DropReason reason) noexcept {
  if (std::exchange(subscription.is_ended, true)) {
    return;
  }
  subscription.close(reason);
  if (subscription.quality != nullptr) {
    subscription.quality->end();
    if (TimerCore* timer = subscription.quality->timer) {
      timer->due_ns = base::kNever;
    }
  }
  end_credits(subscription);
  dying_.push_back(std::move(subscription.callback));
  publishing.has_leftovers = true;
}

TimerCore& Actor::add_timer(const TimerOptions& options, TickCallback callback, TimerRole role) {
  TimerStatistics& its_statistics = statistics_of_timer(
      role.name.empty() ? fmt::format("timer {}", timers_.size()) : role.name, role.cause);
  timers_.push_back(std::make_unique<TimerCore>(*this, timers_.size(), options, std::move(callback),
                                                std::move(role)));
  timers_.back()->statistics = &its_statistics;
  return *timers_.back();
}

TimerStatistics& Actor::statistics_of_timer(const std::string& its_name, Cause cause) {
  const std::lock_guard lock(timer_mutex_);
  for (TimerStatistics& its : timer_statistics_) {
    if (!its.is_taken && its.name == its_name && its.cause == cause) {
      its.is_taken = true;
      return its;
    }
  }
  return timer_statistics_.emplace_back(its_name, cause);
}

std::vector<const TimerStatistics*> Actor::timer_statistics() const {
  const std::lock_guard lock(timer_mutex_);
  std::vector<const TimerStatistics*> all;
  for (const TimerStatistics& its : timer_statistics_) {
    all.push_back(&its);
  }
  return all;
}

TimerCore& Actor::add_watch(Watch& its_watch) {
  timers_.push_back(std::make_unique<TimerCore>(*this, timers_.size(), TimerOptions(),
                                                TickCallback(), TimerRole()));
  TimerCore& timer = *timers_.back();
  timer.watch = &its_watch;
  if (publishing.is_in_activation) {
    its_watch.begin(base::to_ns(publishing.now));
    timer.due_ns = its_watch.next_look_ns();
  }
  return timer;
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
  if (is_suspended() && !is_resuming_) {
    return;  // It would tick as soon as the component is active again.
  }
  timer.due_ns = std::max(base::to_ns(due), base::to_ns(publishing.now));
  timer.armed_in_turn = turn_;
}

}  // namespace fastcycle::detail

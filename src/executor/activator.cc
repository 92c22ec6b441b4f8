#include "executor/activator.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "base/fork.h"
#include "broker/topic.h"

namespace fastcycle::detail {

Activator::Activator(ActorBase& actor, TurnClock& clock, HeldOrigins& held,
                     SubscriptionSet& subscriptions, ActorCredits& credits,
                     ReportFault report_fault)
    : actor_(actor),
      clock_(clock),
      held_(held),
      subscriptions_(subscriptions),
      credits_(credits),
      report_fault_(std::move(report_fault)) {}

template <typename Body, typename Where>
void Activator::activate(ActivationRing& ring, ActivationRecord record, ActivationTarget target,
                         const Origin* origin, base::CoarseHistogram* run_time, const Body& body,
                         const Where& where) {
  const std::int64_t begin_ns = clock_.read_ns();
  PublishingComponent& publishing = actor_.publishing;
  ActorStatistics& statistics = actor_.statistics;
  publishing.now = std::max(base::from_ns(record.time_ns), publishing.now);
  publishing.publish_count = 0;
  record.component = actor_.index;
  record.number = ++number_;
  record.begin_ns = begin_ns;
  const ActivationContext context(actor_, publishing, record, target);
  if (subscriptions_.has_views()) {
    subscriptions_.refresh_views();
  }
  Origin held;
  if (origin == nullptr) {
    // After the views: what they show now is what a timer publishes of.
    held = held_.oldest(base::to_ns(publishing.now));
    origin = &held;
  }
  publishing.origin = origin;
  record.time_ns = base::to_ns(publishing.now);
  const std::uint64_t place = ring.begin(record);
  record.outcome = Outcome::kDone;
  try {
    body();
    if (publishing.key_frames != nullptr) [[unlikely]] {
      publishing.key_frames->end_activation();
    }
  } catch (const std::exception& exception) {
    record.outcome = Outcome::kFault;
    fault_ = where() + exception.what();
  } catch (...) {
    record.outcome = Outcome::kFault;
    fault_ = where() + "something that is no std::exception";
  }
  clock_.set(std::max(begin_ns, base::monotonic_ns()));
  record.duration_ns = clock_.read_ns() - begin_ns;
  record.publish_count = publishing.publish_count;
  record.published_ns = record.publish_count == 0 ? 0 : base::to_ns(publishing.published);
  statistics.activations.add();
  statistics.callback.record(record.duration_ns);
  if (run_time != nullptr) {
    run_time->record(record.duration_ns);
  }
  if (record.outcome != Outcome::kFault) {
    ring.end(place, record);
  }
  if (publishing.has_leftovers) {
    finish_leftovers();
  }
  if (record.outcome == Outcome::kFault) {
    statistics.faults.add();
    running_activation.timer = nullptr;  // A restart creates its timers again.
    report_fault_(fault_);
    if (publishing.has_leftovers) {
      finish_leftovers();  // Of a restart.
    }
    // After the fault handling: once the record has ended, recorders take its reads.
    ring.end(place, record);
    clock_.read();  // A restart takes long.
  }
  if (publishing.follower != nullptr) [[unlikely]] {
    publishing.follower->ring();
  }
  publishing.origin = &PublishingComponent::kNoOrigin;
  publishing.trails = nullptr;
}

void Activator::finish_leftovers() noexcept {
  if (base::has_forked()) {
    end_forked_child();
  }
  actor_.publishing.has_leftovers = false;
  subscriptions_.destroy_ended();
  credits_.finish_asking();
}

void Activator::run(ActivationRing& ring, const Inbox::Head& head) {
  Lane& lane = *head.lane;
  Envelope& envelope = *head.head.envelope;
  auto& subscription = static_cast<CallbackSubscription&>(lane.subscription);
  const bool ages = lane.options.ages;  // The callback may end the subscription, and its lane.
  const Time published = base::from_ns(head.head.time_ns);
  Time now = clock_.now();
  if (now < published && !actor_.clock.is_simulated()) {
    now = published;  // It came after the clock was read.
    clock_.pass(published);
  }
  lane.delivered.add();
  ActivationRecord record;
  const bool is_input = lane.options.is_external && subscription.cause == Cause::kMessage;
  record.cause = is_input ? Cause::kExternal : subscription.cause;
  record.subscription = static_cast<std::uint16_t>(
      std::min<std::uint32_t>(subscription.number, ActivationRecord::kNoSubscription));
  record.publisher = lane.publisher;
  record.key = head.head.sequence;
  record.time_ns = base::to_ns(now);
  record.cause_ns = head.head.time_ns;
  if (held_.root_count() != 0) [[unlikely]] {
    actor_.publishing.trails = envelope.trails;
  }
  activate(
      ring, record, {.subscription = &subscription}, &envelope.info.origin, &subscription.run_time,
      [&] { (*subscription.callback)(envelope, *head.head.payload); },
      [&] { return "its callback for \"" + subscription.topic.name + "\" threw: "; });
  // The callback must not wait for what only statistics and later timers need.
  subscription.latency.record((now - published).count());
  if (ages && !subscription.is_ended) {
    held_.hold(subscription, envelope);
  }
  release(&envelope);
}

void Activator::run(ActivationRing& ring, TimerCore& timer, const Tick& tick) {
  const std::int64_t now = clock_.now_ns();
  actor_.statistics.overruns.add(tick.skipped);
  actor_.statistics.lateness.record(now - base::to_ns(tick.due));
  ActivationRecord record;
  record.cause = timer.role.cause;
  record.key = timer.number;
  record.skipped = tick.skipped;
  record.time_ns = now;
  record.cause_ns = base::to_ns(tick.due);
  activate(
      ring, record, {.timer = &timer}, nullptr, &timer.statistics->run_time,
      [&] { timer.callback(tick); }, [&] { return timer.role.label + " threw: "; });
}

void Activator::run(ActivationRing& ring, const Control& control) {
  clock_.read();
  ActivationRecord record;
  record.cause = control.cause;
  record.key = control.key;
  record.time_ns = record.cause_ns = clock_.now_ns();
  activate(ring, record, {}, nullptr, nullptr, control.body, [] { return std::string(); });
  if (control.finished) {
    control.finished();
  }
}

void Activator::run(ActivationRing& ring, const Watch& watch, const QosEvent& event) {
  const auto callback = watch.callback();
  if (callback == nullptr) {
    return;
  }
  ActivationRecord record;
  record.cause = Cause::kEvent;
  record.key = Control::kNoTimer;
  record.time_ns = record.cause_ns = clock_.now_ns();
  activate(
      ring, record, {}, nullptr, nullptr,
      [&] {
        watch.keep(actor_.publishing, event);
        (*callback)(event);
      },
      [&] { return "its callback for events of \"" + std::string(event.topic) + "\" threw: "; });
}

}  // namespace fastcycle::detail

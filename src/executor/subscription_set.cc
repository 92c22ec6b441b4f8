#include "executor/subscription_set.h"

#include <algorithm>
#include <utility>

#include "broker/quality.h"
#include "broker/topic.h"
#include "executor/delivery_filter.h"
#include "executor/synchronizer.h"
#include "executor/timer_set.h"

namespace fastcycle::detail {

SubscriptionSet::SubscriptionSet(ActorBase& actor, HeldOrigins& held, ActorCredits& credits,
                                 ReportBreaches report_breaches)
    : actor_(actor), held_(held), credits_(credits), report_breaches_(std::move(report_breaches)) {}

SubscriptionSet::~SubscriptionSet() = default;

CallbackSubscription& SubscriptionSet::add(Topic& topic, const SubscriberOptions& options,
                                           EnvelopeCallback callback) {
  auto subscription =
      std::make_unique<CallbackSubscription>(topic, actor_, options, std::move(callback));
  CallbackSubscription& result = *subscription;
  topic.add(std::move(subscription));
  result.number = static_cast<std::uint32_t>(callbacks_.size());
  if (result.quality != nullptr) {
    result.quality->place = result.number;
  }
  callbacks_.push_back(&result);
  actor_.publishing.has_subscribers = true;
  return result;
}

CallbackSubscription& SubscriptionSet::add_again(Topic& topic, const SubscriberOptions& options,
                                                 EnvelopeCallback callback) {
  for (CallbackSubscription* old : callbacks_) {
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
      }
      return *old;
    }
  }
  return add(topic, options, std::move(callback));
}

Synchronizer& SubscriptionSet::synchronize(std::span<Topic* const> topics,
                                           std::span<const SubscriberOptions> queues,
                                           const SynchronizerOptions& options,
                                           EnvelopeSetCallback callback) {
  synchronizers_.push_back(
      std::make_unique<Synchronizer>(actor_, held_, topics.size(), options, std::move(callback)));
  Synchronizer& synchronizer = *synchronizers_.back();
  for (std::size_t i = 0; i < topics.size(); ++i) {
    auto input =
        std::make_unique<SynchronizerInput>(*topics[i], actor_, queues[i], synchronizer, i);
    synchronizer.connect(*input);
    input->number = static_cast<std::uint32_t>(callbacks_.size());
    if (input->quality != nullptr) {
      input->quality->place = input->number;
    }
    callbacks_.push_back(input.get());
    topics[i]->add(std::move(input));
  }
  actor_.publishing.has_subscribers = true;
  return synchronizer;
}

void SubscriptionSet::end(CallbackSubscription& subscription, DropReason reason) noexcept {
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
  for (const auto& lane : subscription.lanes()) {
    held_.forget(lane->publisher);
  }
  credits_.end(subscription);
  ended_.push_back(std::move(subscription.callback));
  actor_.publishing.has_leftovers = true;
}

void SubscriptionSet::close(DropReason reason) noexcept {
  for (CallbackSubscription* subscription : callbacks_) {
    if (reason != DropReason::kFault || !subscription->outlives_faults) {
      subscription->close(reason);
      credits_.end(*subscription);
    }
  }
  for (View* view : views_) {
    view->close(reason);
  }
  drop_held(reason);
}

void SubscriptionSet::drop_held(DropReason reason) noexcept {
  for (const auto& synchronizer : synchronizers_) {
    synchronizer->drop_held(reason);
  }
}

void SubscriptionSet::destroy_ended() noexcept {
  // A callback may own the handle of another subscription, which ends with it.
  while (!ended_.empty()) {
    const auto callbacks_to_destroy = std::exchange(ended_, {});
  }
}

void SubscriptionSet::destroy_callbacks() noexcept {
  for (CallbackSubscription* subscription : callbacks_) {
    if (subscription->callback != nullptr) {
      ended_.push_back(std::move(subscription->callback));
    }
  }
  destroy_ended();
}

void SubscriptionSet::refresh_views() {
  if (!is_following_) {
    take_for_views();
  }
  for (View* view : views_) {
    view->forget_old(actor_.publishing.now);
  }
}

void SubscriptionSet::take_for_views() {
  Time& now = actor_.publishing.now;
  for (const auto& lane : actor_.inbox.views()) {
    auto& view = static_cast<View&>(lane->subscription);
    Lane::Head head;
    while (lane->peek(head)) {
      if (!lane->pop(head)) {
        continue;
      }
      if (lane->options.is_judged) {
        const auto verdict = DeliveryFilter::judge_for_view(*lane, head, now);
        if (verdict.breached != 0) {
          report_breaches_(view, verdict.breached);
        }
        if (verdict.decision == DeliveryFilter::Decision::kDrop) {
          release(head.envelope);
          continue;
        }
      }
      lane->delivered.add();
      if (lane->options.ages) {
        held_.hold(view, *head.envelope);
      }
      actor_.publishing.learned(ReadKind::kTaken, lane->publisher, head.sequence, view.number);
      if (view.topic.is_left_out) {
        actor_.publishing.learned(ReadKind::kPublished, lane->publisher,
                                  static_cast<std::uint64_t>(head.time_ns), view.number);
      }
      // It may have come after the clock was read.
      now = std::max(now, base::from_ns(head.time_ns));
      view.insert(head.envelope);
    }
  }
}

void SubscriptionSet::add(View& view) {
  view.number = static_cast<std::uint32_t>(views_.size());
  views_.push_back(&view);
}

bool SubscriptionSet::peek_outliving(Inbox::Head& found) noexcept {
  for (CallbackSubscription* subscription : callbacks_) {
    if (!subscription->outlives_faults) {
      continue;
    }
    for (const auto& lane : subscription->lanes()) {
      if (lane->peek(found.head)) {
        found.lane = lane.get();
        return true;
      }
    }
  }
  return false;
}

}  // namespace fastcycle::detail

#include "executor/delivery_filter.h"

#include <algorithm>

#include "base/clock.h"
#include "broker/chain_end.h"
#include "broker/quality.h"
#include "broker/subscription.h"

namespace fastcycle::detail {
namespace {

using Decision = DeliveryFilter::Decision;
using Verdict = DeliveryFilter::Verdict;

Verdict take_by_quality(Quality& quality, const Inbox::Head& head, Time now) {
  if (head.lane->is_closed()) {
    // The subscription has ended, and the owner of its callback for events may be gone.
    return {.decision = Inbox::pop(head) ? Decision::kDeliver : Decision::kGone};
  }
  QosEvent event;
  const auto verdict = quality.judge(*head.lane, head.head, base::to_ns(now), event);
  if (verdict == Quality::Verdict::kReport) {
    return {.decision = Decision::kWait, .event = event};
  }
  if (!Inbox::pop(head)) {
    return {.decision = Decision::kGone};
  }
  quality.took(*head.lane, head.head);
  if (verdict == Quality::Verdict::kDeliver) {
    return {};
  }
  quality.expired.add();
  return {.decision = Decision::kDrop, .event = event};
}

void judge_chains(ChainEnd& end, const Envelope& envelope, Time now, Verdict& verdict) {
  const ChainEnd::Verdict of_chains = end.judge(envelope.trails, now);
  verdict.breached = of_chains.breached;
  if (of_chains.is_dropped) {
    verdict.decision = Decision::kDrop;
  }
}

}  // namespace

Verdict DeliveryFilter::take(const Inbox::Head& head, Time now) {
  const Subscription& subscription = head.lane->subscription;
  Verdict verdict;
  if (subscription.quality != nullptr) {
    verdict = take_by_quality(*subscription.quality, head, now);
  } else if (!Inbox::pop(head)) {
    verdict.decision = Decision::kGone;
  }
  if (verdict.decision == Decision::kDeliver && subscription.chain_end != nullptr &&
      !head.lane->is_closed()) {
    judge_chains(*subscription.chain_end, *head.head.envelope, now, verdict);
  }
  return verdict;
}

Verdict DeliveryFilter::judge_for_view(const Lane& lane, const Lane::Head& head, Time now) {
  const Subscription& subscription = lane.subscription;
  Verdict verdict;
  if (subscription.quality != nullptr &&
      subscription.quality->is_expired(head.time_ns, base::to_ns(now))) {
    subscription.quality->expired.add();
    verdict.decision = Decision::kDrop;
  } else if (subscription.chain_end != nullptr) {
    judge_chains(*subscription.chain_end, *head.envelope,
                 std::max(now, base::from_ns(head.time_ns)), verdict);
  }
  return verdict;
}

}  // namespace fastcycle::detail

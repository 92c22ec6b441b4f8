#include "broker/subscription.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "broker/chain_end.h"
#include "broker/inbox.h"
#include "broker/quality.h"
#include "broker/topic.h"
#include "fastcycle/assert.h"

namespace fastcycle::detail {

std::uint64_t Ledger::dropped_total() const noexcept {
  return std::accumulate(dropped.begin(), dropped.end(), std::uint64_t{0});
}

const char* to_word(DropReason reason) noexcept {
  switch (reason) {
    case DropReason::kOverflow:
      return "overflow";
    case DropReason::kSuperseded:
      return "superseded";
    case DropReason::kPool:
      return "pool";
    case DropReason::kFault:
      return "fault";
    case DropReason::kShutdown:
      return "shutdown";
    case DropReason::kUnsubscribed:
      return "unsubscribed";
    case DropReason::kInactive:
      return "inactive";
    case DropReason::kUnmatched:
      return "unmatched";
    case DropReason::kExpired:
      return "expired";
    case DropReason::kStale:
      return "stale";
    case DropReason::kProcess:
      return "process";
    case DropReason::kLink:
      return "link";
    case DropReason::kInjected:
      return "injected";
    case DropReason::kCount:
      break;
  }
  return "?";
}

Subscription::Subscription(Topic& topic_, Inbox& inbox_, std::string component_, Kind kind_,
                           const SubscriberOptions& options)
    : topic(topic_),
      inbox(inbox_),
      component(std::move(component_)),
      kind(kind_),
      holder(kind_ == Kind::kTap ? kNobody : topic_.next_holder()),
      depth(options.depth.value_or(kDefaultDepth)),
      overflow(options.overflow.value_or(Overflow::kDropOldest)),
      keep(options.keep),
      quality(kind_ != Kind::kTap && Quality::is_asked_for(topic_, options)
                  ? std::make_unique<Quality>(topic_, options)
                  : nullptr),
      chain_end(kind_ != Kind::kTap && !topic_.ends.empty()
                    ? std::make_unique<ChainEnd>(topic_.ends)
                    : nullptr) {
  set_history(options);
  FASTCYCLE_ASSERT(depth > 0, "at least one message may wait for a subscription");
}

Subscription::~Subscription() = default;

bool Subscription::is_judged_by_quality() const noexcept {
  return quality != nullptr && quality->is_judging();
}

void Subscription::set_history(const SubscriberOptions& options) noexcept {
  history = static_cast<std::uint16_t>(
      std::min<std::size_t>(options.history.value_or(Lane::kWholeHistory), Lane::kWholeHistory));
}

std::shared_ptr<Lane> Subscription::add_lane(PublisherId publisher, std::string_view from,
                                             bool is_external, bool ages, bool is_imported,
                                             std::shared_ptr<LaneCredit> credit) {
  const std::lock_guard lock(mutex_);
  auto lane = std::make_shared<Lane>(
      *this, publisher,
      Lane::Options{.depth = depth,
                    .overflow = overflow,
                    .is_view = !is_called(),
                    .is_external = is_external,
                    .ages = ages,
                    .is_judged = chain_end != nullptr || is_judged_by_quality(),
                    .is_imported = is_imported,
                    .history = history,
                    .room = inbox.lane_room},
      std::move(credit));
  // Lanes that both ends have left only count from now on.
  std::erase_if(lanes_, [this](const std::shared_ptr<Lane>& old) {
    const bool is_done = old->is_left_by_publisher.load() && old->is_left_by_receiver.load();
    if (is_done) {
      add_to(retired_, *old);
    }
    return is_done;
  });
  lanes_.push_back(lane);
  if (quality != nullptr) {
    quality->add(lane, from);
  }
  return lane;
}

std::vector<std::shared_ptr<Lane>> Subscription::lanes() const {
  const std::lock_guard lock(mutex_);
  return lanes_;
}

void Subscription::close(DropReason reason) noexcept {
  for (const auto& lane : lanes()) {
    auto expected = DropReason::kCount;
    if (lane->close_reason.compare_exchange_strong(expected, reason, std::memory_order_seq_cst)) {
      // A push that did not see the mark is visible from here on; one that does takes its own back.
      lane->drained.add(lane->drain());
    }
  }
}

std::vector<std::shared_ptr<LaneCredit>> Subscription::credits() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<LaneCredit>> credits;
  for (const auto& lane : lanes_) {
    if (lane->credit != nullptr) {
      credits.push_back(lane->credit);
    }
  }
  return credits;
}

void Subscription::add_to(Ledger& ledger, const Lane& lane) const noexcept {
  const auto drop = [&](DropReason reason, std::uint64_t count) {
    if (reason != DropReason::kCount) {
      ledger.dropped[static_cast<std::size_t>(reason)] += count;
    }
  };
  ledger.published += lane.published.get();
  ledger.delivered += lane.delivered.get();
  const bool is_view = kind == Kind::kLatest || kind == Kind::kHistory;
  drop(is_view ? DropReason::kSuperseded : DropReason::kOverflow, lane.overflowed.get());
  drop(DropReason::kPool, lane.dropped_by_pool.get());
  drop(lane.options.is_imported ? DropReason::kProcess : DropReason::kShutdown,
       lane.dropped_outside.get());
  drop(lane.close_reason.load(), lane.drained.get() + lane.dropped_after_close.get());
  ledger.queued += lane.queued();
}

namespace {

/// Counts only the messages in `decided` of those taken from the lanes as delivered.
void put_aside(Ledger& ledger, const Ledger& decided) noexcept {
  const std::uint64_t settled = decided.delivered + decided.dropped_total();
  ledger.queued += ledger.delivered > settled ? ledger.delivered - settled : 0;
  ledger.delivered = decided.delivered;
  for (std::size_t reason = 0; reason < decided.dropped.size(); ++reason) {
    ledger.dropped[reason] += decided.dropped[reason];
  }
}

}  // namespace

Ledger Subscription::ledger() const {
  // Between the two, something may move; then look again, a bounded number of times.
  Ledger ledger;
  for (int attempt = 0; attempt < 8; ++attempt) {
    const std::lock_guard lock(mutex_);
    Ledger decided;
    const bool is_put_aside = add_decided(decided);  // First: what it counts, the lanes count too.
    ledger = retired_;
    ledger.dropped[static_cast<std::size_t>(DropReason::kInactive)] += inactive.get();
    ledger.dropped[static_cast<std::size_t>(DropReason::kProcess)] += left_out.get();
    const std::uint64_t lost = lost_on_link.load(std::memory_order_relaxed);
    ledger.published += lost;
    ledger.dropped[static_cast<std::size_t>(DropReason::kLink)] += lost;
    const std::uint64_t injected = lost_by_injection.load(std::memory_order_relaxed);
    ledger.published += injected;
    ledger.dropped[static_cast<std::size_t>(DropReason::kInjected)] += injected;
    for (const auto& lane : lanes_) {
      add_to(ledger, *lane);
    }
    if (is_put_aside) {
      put_aside(ledger, decided);
    }
    if (quality != nullptr) {
      ledger.dropped[static_cast<std::size_t>(DropReason::kExpired)] += quality->expired.get();
    }
    if (chain_end != nullptr) {
      ledger.dropped[static_cast<std::size_t>(DropReason::kStale)] += chain_end->stale.get();
    }
    if (ledger.adds_up()) {
      break;
    }
  }
  return ledger;
}

}  // namespace fastcycle::detail

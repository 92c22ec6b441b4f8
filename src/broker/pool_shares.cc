#include "broker/pool_shares.h"

#include <algorithm>

#include "broker/subscription.h"
#include "broker/topic.h"

namespace fastcycle::detail {
namespace {

bool is_power_of_ten(std::uint64_t number) noexcept {
  while (number > 1 && number % 10 == 0) {
    number /= 10;
  }
  return number == 1;
}

/// How many messages a subscription may hold: those that wait, the one in its callback, the kept.
std::size_t held_by(const Lane& lane) noexcept {
  return lane.options.depth + 1 + lane.subscription.keep;
}

}  // namespace

// One being written, one more that a component may borrow beside it, and what is kept.
PoolShares::PoolShares(const Topic& topic, const PublishingComponent& owner, std::size_t keep,
                       std::size_t latched, std::size_t pool_max) noexcept
    : topic_(topic), owner_(owner), keep_(keep), pool_max_(pool_max), needed_(2 + keep + latched) {}

void PoolShares::join(const Lane& lane) noexcept {
  needed_ += held_by(lane);
  ++lanes_;
}

void PoolShares::leave(const Lane& lane) noexcept {
  needed_ -= held_by(lane);
  --lanes_;
}

std::size_t PoolShares::limit() const noexcept {
  return pool_max_ != 0 ? std::max(pool_max_, needed_) : 2 * needed_ + 64;
}

/// So many messages may be on their way to a subscriber, or kept by its component, that no other
/// one can run short: what it asked for, and its part of those that the pool may have beyond what
/// all asked for.
std::size_t PoolShares::share_of(const Lane& lane) const noexcept {
  const std::size_t spare = limit() - needed_;
  const std::size_t others = (lanes_ - 1) * keep_;
  return held_by(lane) + keep_ + (spare - std::min(spare, others)) / lanes_;
}

bool PoolShares::keeps_too_much(const Lane& lane, const Pool& pool) const noexcept {
  const Subscription& subscription = lane.subscription;
  const std::size_t kept = pool.kept_by(subscription.holder);
  if (kept <= subscription.keep + keep_) {
    return false;
  }
  // Views and synchronizers hold messages by design.
  const bool is_plain = subscription.kind == Subscription::Kind::kCallback;
  const std::size_t in_use = lane.queued() + 1 + (is_plain ? 0 : subscription.keep);
  return kept + in_use >= share_of(lane);
}

std::size_t PoolShares::find_held_back(std::span<const Target> targets,
                                       const Pool& pool) const noexcept {
  std::size_t count = 0;
  for (const Target& target : targets) {
    target.lane->is_held_back = keeps_too_much(*target.lane, pool);
    count += target.lane->is_held_back ? 1 : 0;
  }
  return count;
}

void PoolShares::hold_back(Lane& lane, const Pool& pool) const noexcept {
  lane.published.add();
  lane.dropped_by_pool.add();
  if (topic_.pool_watch != nullptr && is_power_of_ten(lane.dropped_by_pool.get())) {
    topic_.pool_watch->ran_short({.kind = PoolShortage::Kind::kKept,
                                  .topic = topic_,
                                  .publisher = owner_.name,
                                  .component = lane.subscription.component,
                                  .held = pool.kept_by(lane.subscription.holder),
                                  .share = share_of(lane),
                                  .limit = limit()});
  }
}

void PoolShares::report_shortage(std::span<const Target> targets, const Pool& pool,
                                 std::size_t loans) noexcept {
  if (topic_.pool_watch == nullptr || !is_power_of_ten(++dry_count_)) {
    return;
  }
  PoolShortage shortage{.kind = PoolShortage::Kind::kLoans,
                        .topic = topic_,
                        .publisher = owner_.name,
                        .component = owner_.name,
                        .held = loans,
                        .share = 2 + keep_,
                        .limit = limit()};
  for (const Target& target : targets) {
    const Subscription& subscription = target.lane->subscription;
    const std::size_t held = pool.kept_by(subscription.holder) + target.lane->queued();
    if (held > shortage.held) {
      shortage.kind = PoolShortage::Kind::kSmall;
      shortage.component = subscription.component;
      shortage.held = held;
      shortage.share = share_of(*target.lane);
    }
  }
  if (shortage.held <= shortage.share) {
    shortage.kind = PoolShortage::Kind::kSmall;
  }
  topic_.pool_watch->ran_short(shortage);
}

}  // namespace fastcycle::detail

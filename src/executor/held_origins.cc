#include "executor/held_origins.h"

#include <algorithm>
#include <array>

#include "broker/quality.h"
#include "broker/subscription.h"

namespace fastcycle::detail {
namespace {

/// So many are found sooner one after the other than by halves.
constexpr std::size_t kFew = 64;

}  // namespace

std::size_t HeldOrigins::find(PublisherId publisher) {
  if (held_.size() <= kFew) {
    const auto few = std::ranges::find(held_, publisher, &Held::publisher);
    if (few != held_.end()) {
      return static_cast<std::size_t>(few - held_.begin());
    }
  }
  auto found = std::ranges::lower_bound(places_, publisher, {}, &Place::publisher);
  if (found == places_.end() || found->publisher != publisher) {
    found = places_.insert(found, {publisher, held_.size()});
    held_.push_back({.publisher = publisher});
  }
  return found->place;
}

void HeldOrigins::hold(const Envelope& envelope, std::int64_t end_ns) {
  for (std::size_t root = 0; root < trails_.size(); ++root) {
    const Trail& trail = envelope.trails[root];
    Trail& held = trails_[root];
    if (trail.is_known() && (!held.is_known() || held.taken() <= trail.taken())) {
      held = trail;
    }
  }
  const MessageInfo& info = envelope.info;
  Held& held = of(info.publisher);
  const std::int64_t published_ns = base::to_ns(info.publish_time);
  if (published_ns < held.published_ns) {
    return;  // Another subscription has a newer one.
  }
  if (held.origin.root != info.origin.root) {
    held.is_own = std::ranges::find(owner_.publishers, info.origin.root) != owner_.publishers.end();
  }
  held.origin = info.origin;
  held.published_ns = published_ns;
  held.end_ns = end_ns;
}

void HeldOrigins::hold(const Subscription& subscription, const Envelope& envelope) {
  const auto lifespan =
      subscription.quality == nullptr ? std::nullopt : subscription.quality->lifespan();
  hold(envelope, lifespan ? base::to_ns(envelope.info.publish_time + *lifespan) + 1 : base::kNever);
}

void HeldOrigins::forget(PublisherId publisher) noexcept {
  const auto found = std::ranges::lower_bound(places_, publisher, {}, &Place::publisher);
  if (found != places_.end() && found->publisher == publisher) {
    held_[found->place] = {.publisher = publisher};
  }
}

void HeldOrigins::clear() noexcept {
  held_.clear();
  places_.clear();
  for (Trail& trail : trails_) {
    trail.forget();
  }
}

Origin HeldOrigins::oldest(std::int64_t now_ns) const noexcept {
  struct Root {
    std::uint64_t root;
    Time taken;
  };
  std::array<Root, 16> roots;
  std::size_t count = 0;
  for (const Held& held : held_) {
    if (held.is_own || held.end_ns <= now_ns) {
      continue;
    }
    const auto end = roots.begin() + static_cast<std::ptrdiff_t>(count);
    const auto same = std::find_if(roots.begin(), end,
                                   [&](const Root& root) { return root.root == held.origin.root; });
    if (same != end) {
      same->taken = std::max(same->taken, held.origin.taken);
    } else if (count < roots.size()) {
      roots[count++] = {held.origin.root, held.origin.taken};
    } else {
      // More roots than places: drops the newest, since the oldest is needed.
      const auto newest = std::ranges::max_element(roots, {}, &Root::taken);
      if (held.origin.taken < newest->taken) {
        *newest = {held.origin.root, held.origin.taken};
      }
    }
  }
  Origin oldest;
  for (std::size_t i = 0; i < count; ++i) {
    if (oldest.root == 0 || roots[i].taken < oldest.taken) {
      oldest = {.taken = roots[i].taken, .root = roots[i].root, .held = true};
    }
  }
  return oldest;
}

}  // namespace fastcycle::detail

#include "executor/subscriptions.h"

#include <algorithm>
#include <utility>

namespace fastcycle::detail {
namespace {

SubscriberOptions view_options(std::size_t depth, std::optional<Duration> lifespan) {
  return {.depth = depth, .overflow = Overflow::kDropOldest, .keep = depth, .lifespan = lifespan};
}

}  // namespace

CallbackSubscription::CallbackSubscription(Topic& its_topic, ActorBase& its_actor,
                                           const SubscriberOptions& options,
                                           EnvelopeCallback its_callback, Kind its_kind)
    : Subscription(its_topic, its_actor.inbox, its_actor.name, its_kind, options),
      actor(its_actor),
      callback(std::make_unique<EnvelopeCallback>(std::move(its_callback))) {}

View::View(Topic& its_topic, ActorBase& its_actor, Kind its_kind, std::size_t its_depth,
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

}  // namespace fastcycle::detail

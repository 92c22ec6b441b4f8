#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "broker/quality.h"
#include "broker/subscription.h"
#include "executor/activation_ring.h"
#include "executor/actor_base.h"
#include "fastcycle/component.h"

namespace fastcycle::detail {

/// A subscription whose messages are passed to a callback.
class CallbackSubscription : public Subscription {
 public:
  CallbackSubscription(Topic& its_topic, ActorBase& its_actor, const SubscriberOptions& options,
                       EnvelopeCallback its_callback, Kind its_kind = Kind::kCallback);

  ActorBase& actor;
  /// On the heap, so that it can outlive the subscription if that ends while it runs.
  std::unique_ptr<EnvelopeCallback> callback;
  Cause cause = Cause::kMessage;  ///< Of its activations.
  std::uint32_t number = 0;       ///< Among all of its component.
  bool is_ended = false;
  /// Its callback is the framework's: it continues after a fault, and while the component is not
  /// active.
  bool outlives_faults = false;
  /// Time in its callback, ns by CLOCK_MONOTONIC. Written by the component's worker.
  base::CoarseHistogram run_time;
};

/// The last messages of a topic, taken over when an activation starts.
class View final : public Subscription {
 public:
  View(Topic& its_topic, ActorBase& its_actor, Kind its_kind, std::size_t its_depth,
       std::optional<Duration> its_span, std::optional<Duration> its_lifespan = {});
  ~View() override;

  /// Takes over `envelope` and its reference; the oldest is dropped if it is full.
  void insert(Envelope* envelope);
  /// Releases messages older than the span, or than their lifespan.
  void forget_old(Time now) noexcept;
  void clear() noexcept;

  ActorBase& actor;
  const std::optional<Duration> span;
  std::uint32_t number = 0;     ///< Among its component's views.
  std::vector<Envelope*> held;  ///< By publish time, oldest first.
};

}  // namespace fastcycle::detail

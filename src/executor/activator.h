#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "base/histogram.h"
#include "broker/inbox.h"
#include "broker/quality.h"
#include "executor/activation.h"
#include "executor/activation_ring.h"
#include "executor/actor_base.h"
#include "executor/actor_credits.h"
#include "executor/control_queue.h"
#include "executor/held_origins.h"
#include "executor/subscription_set.h"
#include "executor/timer_set.h"
#include "executor/turn_clock.h"

namespace fastcycle::detail {

/// Calls one component: executes each cause as an activation, writes that to the ring, and updates
/// the statistics. After the callback it finishes pending work, and reports a fault.
///
/// @threads  As `Actor`.
class Activator {
 public:
  /// Called after the activation in which a callback threw, in the same turn.
  using ReportFault = std::function<void(std::string_view what)>;

  Activator(ActorBase& actor, TurnClock& clock, HeldOrigins& held, SubscriptionSet& subscriptions,
            ActorCredits& credits, ReportFault report_fault);
  Activator(const Activator&) = delete;
  Activator& operator=(const Activator&) = delete;

  /// Sets the number of the next activation. For a replay.
  void set_next(std::uint64_t number) noexcept { number_ = number - 1; }

  /// Takes over the reference to the message of `head`, which was removed from its lane.
  void run(ActivationRing& ring, const Inbox::Head& head);
  void run(ActivationRing& ring, TimerCore& timer, const Tick& tick);
  void run(ActivationRing& ring, const Control& control);
  /// Notifies the component of an event, if it has a callback for it.
  void run(ActivationRing& ring, const Watch& watch, const QosEvent& event);

 private:
  /// Calls `body` as an activation; `where()` describes what threw, for a fault. Without `origin`
  /// it inherits the held origins. `run_time` is that of the callback, if it has its own.
  template <typename Body, typename Where>
  void activate(ActivationRing& ring, ActivationRecord record, ActivationTarget target,
                const Origin* origin, base::CoarseHistogram* run_time, const Body& body,
                const Where& where);
  void finish_leftovers() noexcept;

  ActorBase& actor_;
  TurnClock& clock_;
  HeldOrigins& held_;
  SubscriptionSet& subscriptions_;
  ActorCredits& credits_;
  const ReportFault report_fault_;
  std::uint64_t number_ = 0;  ///< Of the newest activation.
  std::string fault_;
};

}  // namespace fastcycle::detail

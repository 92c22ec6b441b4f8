#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "broker/inbox.h"
#include "executor/actor_base.h"
#include "executor/actor_credits.h"
#include "executor/held_origins.h"
#include "executor/subscriptions.h"
#include "fastcycle/synchronizer.h"

namespace fastcycle::detail {

class Synchronizer;

/// The subscriptions of one component, with its views and synchronizers: created, ended, recreated
/// and closed here. The callback of an ended one is kept until the end of the activation.
///
/// @threads  As `Actor`.
class SubscriptionSet {
 public:
  /// Called with a subscription whose next message is too late for latency chains: a bit for each
  /// that ends there.
  using ReportBreaches = std::function<void(const Subscription&, std::uint32_t breached)>;

  SubscriptionSet(ActorBase& actor, HeldOrigins& held, ActorCredits& credits,
                  ReportBreaches report_breaches);
  SubscriptionSet(const SubscriptionSet&) = delete;
  SubscriptionSet& operator=(const SubscriptionSet&) = delete;
  ~SubscriptionSet();

  CallbackSubscription& add(Topic& topic, const SubscriberOptions& options,
                            EnvelopeCallback callback);
  /// As `add`, reusing an ended subscription of that topic, if there is one with the same options.
  CallbackSubscription& add_again(Topic& topic, const SubscriberOptions& options,
                                  EnvelopeCallback callback);
  void add(View& view);
  /// Calls `callback` with messages of `topics` that belong together; its subscriptions are the
  /// newest of `callbacks`. `queues` has, for each topic, how many messages may wait before that.
  Synchronizer& synchronize(std::span<Topic* const> topics,
                            std::span<const SubscriberOptions> queues,
                            const SynchronizerOptions& options, EnvelopeSetCallback callback);

  /// Ends `subscription`; a second call does nothing.
  void end(CallbackSubscription& subscription, DropReason reason) noexcept;
  /// Closes all: waiting and later messages are dropped for `reason`. After a fault those that
  /// outlive it stay open.
  void close(DropReason reason) noexcept;
  /// Releases all messages that synchronizers hold, as dropped for `reason`.
  void drop_held(DropReason reason) noexcept;

  /// Destroys the callbacks of ended subscriptions. They may own handles of others, which end with
  /// them. Outside of callbacks.
  void destroy_ended() noexcept;
  /// The same for all callbacks, once nothing is served any more.
  void destroy_callbacks() noexcept;

  /// Moves received messages to the views, limited by their spans. The activation's time advances
  /// to that of the newest message.
  void refresh_views();
  [[nodiscard]] bool has_views() const noexcept { return !views_.empty(); }
  /// While it follows another component, its views take over only what that one's did.
  void follow(bool is_following) noexcept { is_following_ = is_following; }

  /// The oldest message of a subscription that outlives faults, without removing it; false if there
  /// is none. Of several such subscriptions the first that has one.
  [[nodiscard]] bool peek_outliving(Inbox::Head& found) noexcept;

  /// All subscriptions with callbacks, ended ones too, in the order of creation.
  [[nodiscard]] const std::vector<CallbackSubscription*>& callbacks() const noexcept {
    return callbacks_;
  }
  [[nodiscard]] const std::vector<View*>& views() const noexcept { return views_; }
  [[nodiscard]] const std::vector<std::unique_ptr<Synchronizer>>& synchronizers() const noexcept {
    return synchronizers_;
  }

 private:
  void take_for_views();

  ActorBase& actor_;
  HeldOrigins& held_;
  ActorCredits& credits_;
  const ReportBreaches report_breaches_;
  std::vector<View*> views_;
  std::vector<CallbackSubscription*> callbacks_;
  std::vector<std::unique_ptr<Synchronizer>> synchronizers_;
  std::vector<std::unique_ptr<EnvelopeCallback>> ended_;  ///< Their callbacks.
  bool is_following_ = false;
};

}  // namespace fastcycle::detail

#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/clock.h"
#include "broker/publishing_component.h"
#include "broker/trail.h"

namespace fastcycle::detail {

class Subscription;

/// Origins and trails of messages delivered to a component, inherited by what it publishes without
/// a message as the cause.
///
/// A component holds the origin of the newest message of each publisher. It ends with the next
/// message of that publisher, with the lifespan of the message, and with the subscription. So a
/// root ends when no publisher passes it on any more.
///
/// Roots that the component began itself are not held.
///
/// @threads  Confined to the component's activations, and to the control thread before the start.
class HeldOrigins {
 public:
  explicit HeldOrigins(const PublishingComponent& owner) : owner_(owner) {}
  HeldOrigins(const HeldOrigins&) = delete;
  HeldOrigins& operator=(const HeldOrigins&) = delete;

  /// Sets the number of roots of latency chains; before anything is held.
  void set_root_count(std::size_t count) { trails_.resize(count); }
  [[nodiscard]] std::size_t root_count() const noexcept { return trails_.size(); }
  /// By root; null if there are no chains.
  [[nodiscard]] const Trail* trails() const noexcept {
    return trails_.empty() ? nullptr : trails_.data();
  }

  /// `envelope` was delivered; it is held until `end_ns`, on the application's clock.
  void hold(const Envelope& envelope, std::int64_t end_ns = base::kNever);
  /// The same for a message of `subscription`, held no longer than its lifespan.
  void hold(const Subscription& subscription, const Envelope& envelope);
  /// The subscription to `publisher` has ended.
  void forget(PublisherId publisher) noexcept;
  void clear() noexcept;

  /// The oldest, at `now_ns`, among the newest held of each root; without a root if nothing is
  /// held.
  [[nodiscard]] Origin oldest(std::int64_t now_ns) const noexcept;

 private:
  struct Held {
    PublisherId publisher = 0;
    Origin origin{};
    std::int64_t published_ns = 0;
    std::int64_t end_ns = 0;  ///< 0: nothing is held.
    bool is_own = false;      ///< Its root is one of the component's publishers.
  };

  /// Index of a publisher in `held_`.
  struct Place {
    PublisherId publisher = 0;
    std::size_t place = 0;
  };

  [[nodiscard]] Held& of(PublisherId publisher) {
    if (last_ >= held_.size() || held_[last_].publisher != publisher) {
      last_ = find(publisher);
    }
    return held_[last_];
  }
  /// Its index; a new one if it is not held yet.
  [[nodiscard]] std::size_t find(PublisherId publisher);

  const PublishingComponent& owner_;
  std::vector<Held> held_;     ///< In the order of their first messages.
  std::vector<Place> places_;  ///< By publisher: there may be thousands.
  std::size_t last_ = 0;       ///< The last index found: in a burst it is the same again.
  std::vector<Trail> trails_;
};

}  // namespace fastcycle::detail

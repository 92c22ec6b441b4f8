#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "fastcycle/message.h"
#include "fastcycle/qos.h"
#include "fastcycle/sample.h"

namespace fastcycle {

/// The overflow policy of a full queue.
enum class Overflow : std::uint8_t {
  kDropOldest,  ///< For state: only the newest matters.
  kDropNewest,  ///< For events: the earliest are kept.
};

/// The queue and the quality of service of a subscriber. `"subscribers"` in the application file
/// overrides the code.
struct SubscriberOptions {
  std::optional<std::size_t> depth =
      {};  ///< Messages that may wait, per publisher; 16 unless given.
  std::optional<Overflow> overflow = {};  ///< `kDropOldest` unless given.
  std::size_t keep = 0;  ///< Samples that the component holds beyond its callbacks.

  /// How many of a latched topic's retained messages it first receives when it subscribes while
  /// publishers run, per publisher: all unless given, at most `depth`, and none with 0.
  std::optional<std::size_t> history = {};
  /// Longest time between two messages of the topic, of any publisher; each violation is counted
  /// and reported as an event.
  std::optional<Duration> deadline = {};
  /// Messages that are older when their callback would start are `dropped{expired}`; the topic's
  /// lifespan applies if it is shorter.
  std::optional<Duration> lifespan = {};
  /// Longest time between two messages of each publisher; one that is silent for longer is lost.
  std::optional<Duration> liveliness = {};
  /// Called with the events of these options, and when publishers fail, stop and come back.
  QosCallback on_event = {};
};

namespace detail {
class Subscription;
void end_subscription(Subscription& subscription) noexcept;
}  // namespace detail

/// Owns a subscription: after the handle is destroyed, its callback is never called again. A
/// callback may end its own subscription.
///
///     std::optional<fastcycle::Subscriber> goal_;
///     goal_ = context.create_subscriber<demo::Goal>("mission/goal", [this](const demo::Goal& goal)
///     {…}); goal_.reset();
///
/// @threads  Confined to its component's activations.
class Subscriber {
 public:
  /// Constructed from what `Context::create_subscriber` returns.
  explicit Subscriber(detail::Subscription& subscription) : subscription_(&subscription) {}
  /// Takes the subscription over.
  Subscriber(Subscriber&& other) noexcept
      : subscription_(std::exchange(other.subscription_, nullptr)) {}
  /// Swaps the two.
  Subscriber& operator=(Subscriber&& other) noexcept {
    std::swap(subscription_, other.subscription_);
    return *this;
  }
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;
  ~Subscriber() { end(); }

  /// Ends the subscription; messages that still wait are counted as `dropped{unsubscribed}`. A
  /// second call does nothing.
  void end() noexcept {
    if (subscription_ != nullptr) {
      detail::end_subscription(*std::exchange(subscription_, nullptr));
    }
  }

 private:
  detail::Subscription* subscription_;
};

/// The result of `Context::create_subscriber`. If ignored, the subscription lasts as long as its
/// component; converted to a `Subscriber`, it ends with that one.
class Subscribed {
 public:
  /// Constructed by `Context::create_subscriber`.
  explicit Subscribed(detail::Subscription& subscription) : subscription_(&subscription) {}

  /// Converts it to a handle that ends the subscription.
  operator Subscriber() && {  // NOLINT(google-explicit-constructor): reads as an assignment
    return Subscriber(*subscription_);
  }

 private:
  detail::Subscription* subscription_;
};

}  // namespace fastcycle

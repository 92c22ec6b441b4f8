#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "fastcycle/message.h"
#include "fastcycle/qos.h"
#include "fastcycle/sample.h"

namespace fastcycle {

/// What a full queue does with one more message.
enum class Overflow : std::uint8_t {
  kDropOldest,  ///< For state: only the newest matters.
  kDropNewest,  ///< For events: what came first is kept.
};

/// How many messages may wait for a subscriber, and what happens to more. What the application file
/// says under `"subscribers"` stands above what the code says.
struct SubscriberOptions {
  std::optional<std::size_t> depth =
      {};  ///< Messages that may wait, per publisher; 16 unless given.
  std::optional<Overflow> overflow = {};  ///< `kDropOldest` unless given.
  std::size_t keep = 0;  ///< Samples that the component holds beyond its callbacks.

  /// How many of the messages that a latched topic keeps it is given first when it subscribes while
  /// publishers run, per publisher: all unless given, at most `depth`, and none with 0.
  std::optional<std::size_t> history = {};
  /// Longest time between two messages of the topic, whoever published them; each time that it is
  /// over is an event and counted.
  std::optional<Duration> deadline = {};
  /// Messages that are older when their callback would start are `dropped{expired}`; the topic's,
  /// if that is shorter.
  std::optional<Duration> lifespan = {};
  /// Longest time between two messages of each publisher: who is silent for longer is lost.
  std::optional<Duration> liveliness = {};
  /// Called with what becomes of all this, and with publishers that fail, stop and come back.
  QosCallback on_event = {};
};

namespace detail {
class Subscription;
void end_subscription(Subscription& subscription) noexcept;
}  // namespace detail

/// A subscription whose end its owner decides: when the handle is destroyed, its callback is never
/// called again. A callback may end its own subscription.
///
///     std::optional<fastcycle::Subscriber> goal_;
///     goal_ = context.create_subscriber<demo::Goal>("mission/goal", [this](const demo::Goal& goal)
///     {…}); goal_.reset();
///
/// @threads  Confined to its component's activations.
class Subscriber {
 public:
  /// Made from what `Context::create_subscriber` returns.
  explicit Subscriber(detail::Subscription& subscription) : subscription_(&subscription) {}
  /// Takes the subscription over.
  Subscriber(Subscriber&& other) noexcept
      : subscription_(std::exchange(other.subscription_, nullptr)) {}
  /// Both change places.
  Subscriber& operator=(Subscriber&& other) noexcept {
    std::swap(subscription_, other.subscription_);
    return *this;
  }
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;
  ~Subscriber() { end(); }

  /// Ends the subscription; what still waits is counted as `dropped{unsubscribed}`. A second call
  /// does nothing.
  void end() noexcept {
    if (subscription_ != nullptr) {
      detail::end_subscription(*std::exchange(subscription_, nullptr));
    }
  }

 private:
  detail::Subscription* subscription_;
};

/// What `Context::create_subscriber` returns. Left alone, the subscription lives as long as its
/// component; turned into a `Subscriber`, it ends when that one does.
class Subscribed {
 public:
  /// Made by `Context::create_subscriber`.
  explicit Subscribed(detail::Subscription& subscription) : subscription_(&subscription) {}

  /// From now on the handle says when the subscription ends.
  operator Subscriber() && {  // NOLINT(google-explicit-constructor): reads as an assignment
    return Subscriber(*subscription_);
  }

 private:
  detail::Subscription* subscription_;
};

}  // namespace fastcycle

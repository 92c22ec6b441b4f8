#pragma once

#include <cstdint>
#include <functional>
#include <string_view>

#include "fastcycle/time.h"

namespace fastcycle {

/// The kinds of quality-of-service events.
enum class QosKind : std::uint8_t {
  kDeadlineMissed,    ///< No message was published for a whole deadline.
  kLivelinessLost,    ///< A publisher's component failed, stopped or is silent.
  kLivelinessGained,  ///< It is back.
  kMessageExpired,    ///< A message waited longer than its lifespan.
  kMessageLost,       ///< Messages are missing before the next one: the queue was full.
};

/// An event of one of a component's subscriptions or publishers.
struct QosEvent {
  /// What happened.
  QosKind kind{};
  std::string_view topic = {};      ///< Its full name.
  std::string_view publisher = {};  ///< The publishing component; empty: any of the topic's.
  /// Of liveliness: "failed", "stopped", "inactive", "silent"; "restarted", "active", "publishes".
  std::string_view reason = {};
  /// Number of events of this kind, this one included, since the subscription or the publisher was
  /// created: periods of the deadline, messages, changes of liveliness.
  std::uint64_t count = 0;
  /// Of a missed deadline and of a silent publisher: when the last message was published, or when
  /// the watch began. Of an expired message: when it was published. Else the time of the event.
  Time since{};
};

/// Receives the events of a subscription or a publisher: an activation of its component, as any
/// other callback.
using QosCallback = std::function<void(const QosEvent&)>;

}  // namespace fastcycle

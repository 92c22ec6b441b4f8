#pragma once

#include <cstdint>
#include <optional>

#include "broker/inbox.h"
#include "fastcycle/qos.h"

namespace fastcycle::detail {

/// Decides whether the next message of a judged lane is delivered: by the quality of service of its
/// subscription, then by the latency chains that end there.
///
/// @threads  As `Actor`.
/// @realtime No lock, no allocation.
class DeliveryFilter {
 public:
  enum class Decision : std::uint8_t {
    kDeliver,  ///< It was removed, and belongs to the receiver.
    kDrop,     ///< It was removed and counted; the receiver releases it.
    kWait,     ///< It was not removed: the event is reported first.
    kGone,     ///< Its publisher dropped it meanwhile.
  };

  struct Verdict {
    Decision decision = Decision::kDeliver;
    std::optional<QosEvent> event = {};  ///< To be reported.
    std::uint32_t breached = 0;          ///< A bit for each chain that ends at the subscription.
  };

  /// Judges the result of `peek`, which would be delivered at `now`.
  [[nodiscard]] static Verdict take(const Inbox::Head& head, Time now);

  /// Judges a message that was removed for a view: never `kWait` or `kGone`.
  [[nodiscard]] static Verdict judge_for_view(const Lane& lane, const Lane::Head& head, Time now);
};

}  // namespace fastcycle::detail

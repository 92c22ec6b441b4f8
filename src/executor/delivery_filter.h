#pragma once

#include <cstdint>
#include <optional>

#include "broker/inbox.h"
#include "fastcycle/qos.h"

namespace fastcycle::detail {

/// Decides, for a lane whose messages are judged, what becomes of the next one before it is
/// delivered: by the quality of service that its subscription asks for, then by the latency chains
/// that end there.
///
/// @threads  As `Actor`.
/// @realtime No lock, no allocation.
class DeliveryFilter {
 public:
  enum class Decision : std::uint8_t {
    kDeliver,  ///< It was taken out, and is the receiver's.
    kDrop,     ///< It was taken out and counted; the receiver lets go of it.
    kWait,     ///< It is still there: the event is told first.
    kGone,     ///< Its publisher dropped it meanwhile.
  };

  struct Verdict {
    Decision decision = Decision::kDeliver;
    std::optional<QosEvent> event = {};  ///< To be told.
    std::uint32_t breached = 0;          ///< A bit for each chain that ends at the subscription.
  };

  /// Judges what `peek` found, which would be delivered at `now`.
  [[nodiscard]] static Verdict take(const Inbox::Head& head, Time now);

  /// Judges a message that was taken out for a view: never `kWait` or `kGone`.
  [[nodiscard]] static Verdict judge_for_view(const Lane& lane, const Lane::Head& head, Time now);
};

}  // namespace fastcycle::detail

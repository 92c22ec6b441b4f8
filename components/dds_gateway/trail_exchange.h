#pragma once

#include <map>
#include <span>
#include <vector>

#include "broker/publisher_names.h"
#include "broker/trail.h"
#include "dds_gateway/envelope.h"

namespace fastcycle::detail {
class Topics;
}  // namespace fastcycle::detail

namespace fastcycle::dds_gateway {

/// Converts trails of latency chains between two applications: topics and publishers are identified
/// by names there, and by numbers here.
///
/// @threads  `to_envelope` and `from_envelope` may be called by one thread each.
class TrailExchange {
 public:
  /// Borrowed.
  explicit TrailExchange(detail::Topics& topics) : topics_(topics) {}

  /// The trails to send with a message that has `trails`, or none; names are valid as long as this.
  [[nodiscard]] std::vector<EnvelopeTrail> to_envelope(const detail::Trail* trails);
  /// One trail for each root of this application, with `later` added to all times; valid until the
  /// next call. Omits roots of which no chain ends here.
  [[nodiscard]] std::span<const detail::Trail> from_envelope(
      const std::vector<EnvelopeTrail>& trails, Duration later);

 private:
  detail::Topics& topics_;
  std::map<PublisherId, detail::PublisherNames::Names> names_;  // Of the sending publishers.
  std::vector<detail::Trail> arrived_;
};

}  // namespace fastcycle::dds_gateway

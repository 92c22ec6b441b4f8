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

/// The ways of latency chains on their way between two applications: topics and publishers have
/// names there, and numbers here.
///
/// @threads  `to_envelope` and `from_envelope` may be called by one thread each.
class TrailExchange {
 public:
  /// Borrowed.
  explicit TrailExchange(detail::Topics& topics) : topics_(topics) {}

  /// What goes with a message that has `trails`, or none of them; names are valid as long as this.
  [[nodiscard]] std::vector<EnvelopeTrail> to_envelope(const detail::Trail* trails);
  /// One trail for each root of this application, with `later` added to all times; valid until the
  /// next call. Roots of which nothing ends here are left out.
  [[nodiscard]] std::span<const detail::Trail> from_envelope(
      const std::vector<EnvelopeTrail>& trails, Duration later);

 private:
  detail::Topics& topics_;
  std::map<PublisherId, detail::PublisherNames::Names> names_;  // Of who sends.
  std::vector<detail::Trail> arrived_;
};

}  // namespace fastcycle::dds_gateway

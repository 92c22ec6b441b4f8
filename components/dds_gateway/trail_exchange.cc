#include "dds_gateway/trail_exchange.h"

#include <algorithm>
#include <cstddef>
#include <string>

#include "broker/topics.h"

namespace fastcycle::dds_gateway {

std::vector<EnvelopeTrail> TrailExchange::to_envelope(const detail::Trail* trails) {
  std::vector<EnvelopeTrail> all;
  const std::vector<std::string>& roots = topics_.roots();
  for (std::size_t root = 0; trails != nullptr && root < roots.size(); ++root) {
    if (!trails[root].is_known()) {
      continue;
    }
    EnvelopeTrail trail{.root = roots[root], .taken = trails[root].taken()};
    for (const detail::Hop& hop : trails[root].hops()) {
      auto names = names_.find(hop.publisher);
      if (names == names_.end()) {
        if (auto found = topics_.names().find(hop.publisher)) {
          names = names_.emplace(hop.publisher, std::move(*found)).first;
        }
      }
      EnvelopeHop named{.publisher = hop.publisher, .begin = hop.begin, .published = hop.published};
      if (names != names_.end()) {
        named.component = names->second.component;
        named.topic = names->second.topic;
      }
      trail.hops.push_back(named);
    }
    all.push_back(std::move(trail));
  }
  return all;
}

std::span<const detail::Trail> TrailExchange::from_envelope(
    const std::vector<EnvelopeTrail>& trails, Duration later) {
  const std::vector<std::string>& roots = topics_.roots();
  arrived_.resize(roots.size());
  for (detail::Trail& trail : arrived_) {
    trail.forget();
  }
  for (const EnvelopeTrail& from : trails) {
    const auto root = std::ranges::find(roots, from.root);
    if (root == roots.end() || from.hops.empty()) {
      continue;
    }
    detail::Trail& trail = arrived_[static_cast<std::size_t>(root - roots.begin())];
    trail.begin(from.taken + later, from.hops.front().publisher,
                from.hops.front().published + later);
    for (const EnvelopeHop& hop : std::span(from.hops).subspan(1)) {
      trail.add({.publisher = hop.publisher,
                 .begin = hop.begin + later,
                 .published = hop.published + later});
    }
    for (const EnvelopeHop& hop : from.hops) {
      topics_.names().learn(hop.publisher, hop.component, hop.topic);
    }
  }
  return arrived_;
}

}  // namespace fastcycle::dds_gateway

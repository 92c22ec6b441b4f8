#include "dds_gateway/doctor/picture.h"

#include <algorithm>
#include <tuple>

#include "ros2/error.h"
#include "ros2/names.h"

namespace fastcycle::dds_gateway {
namespace {

constexpr std::size_t kParticipantsMax = 4096;
constexpr std::size_t kEndpointsMax = 16'384;

}  // namespace

void Picture::take(const Discovery& discovery) {
  if (discovery.kind == Discovery::Kind::kParticipant) {
    if (discovery.is_gone) {
      participants_.erase(discovery.guid);
      graph_.forget(discovery.guid);
    } else if (participants_.size() < kParticipantsMax || participants_.contains(discovery.guid)) {
      participants_[discovery.guid] = {.guid = discovery.guid,
                                       .user_data = discovery.endpoint.user_data};
    }
    return;
  }
  if (discovery.is_gone) {
    endpoints_.erase(discovery.guid);
  } else if (endpoints_.size() < kEndpointsMax || endpoints_.contains(discovery.guid)) {
    endpoints_[discovery.guid] = {.guid = discovery.guid,
                                  .participant = discovery.participant,
                                  .endpoint = discovery.endpoint,
                                  .node = {}};
  }
}

void Picture::take_graph(std::span<const std::byte> message) {
  try {
    graph_.take(message);
  } catch (const ros2::CdrError&) {
    // Invalid messages of others are ignored: discovery does not depend on them.
  }
}

bool Picture::is_doctor(const Guid& participant) const {
  const auto found = participants_.find(participant);
  return found != participants_.end() &&
         !ros2::value_of(found->second.user_data, "fastcycle_doctor").empty();
}

std::vector<FoundParticipant> Picture::participants() const {
  std::vector<FoundParticipant> all;
  for (const auto& [guid, participant] : participants_) {
    if (!is_doctor(guid)) {
      all.push_back(participant);
    }
  }
  return all;
}

std::vector<FoundEndpoint> Picture::endpoints() const {
  std::vector<FoundEndpoint> all;
  for (const auto& [guid, endpoint] : endpoints_) {
    if (!is_doctor(endpoint.participant)) {
      all.push_back(endpoint);
      all.back().node = graph_.node_of(guid);
    }
  }
  std::ranges::sort(all, {}, [](const FoundEndpoint& one) {
    return std::tuple(one.endpoint.topic, one.endpoint.is_reader, one.node, one.guid);
  });
  return all;
}

}  // namespace fastcycle::dds_gateway

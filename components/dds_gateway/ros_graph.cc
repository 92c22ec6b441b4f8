#include "dds_gateway/ros_graph.h"

#include <algorithm>

#include "ros2/cdr.h"
#include "ros2/names.h"

namespace fastcycle::dds_gateway {
namespace {

constexpr std::string_view kType = "rmw_dds_common/msg/ParticipantEntitiesInfo";
// As the nodes of ROS 2 announce it, from Iron on; they warn of one that is missing.
constexpr std::string_view kTypeHash =
    "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e";
// Minimum size of a node: two texts and two counts.
constexpr std::size_t kNodeBytes = 16;

void put(const Guid& guid, ros2::CdrWriter& out) {
  out.array(std::span<const std::uint8_t>(guid));
}

void put(const std::vector<Guid>& guids, ros2::CdrWriter& out) {
  out.count(guids.size());
  for (const Guid& guid : guids) {
    put(guid, out);
  }
}

/// Nodes count too, since each has names.
std::size_t entities_of(const std::vector<NodeEntities>& nodes) {
  std::size_t count = nodes.size();
  for (const NodeEntities& node : nodes) {
    count += node.readers.size() + node.writers.size();
  }
  return count;
}

Guid take_guid(ros2::CdrReader& in) {
  Guid guid;
  const auto bytes = in.raw("gid", guid.size(), 1);
  in.copy(bytes.data(), guid.data(), guid.size());
  return guid;
}

std::vector<Guid> take_guids(ros2::CdrReader& in, std::string_view field) {
  std::vector<Guid> guids(in.count(field, sizeof(Guid)));
  std::ranges::generate(guids, [&] { return take_guid(in); });
  return guids;
}

}  // namespace

Endpoint graph_endpoint(bool is_reader) {
  return {.topic = "ros_discovery_info",
          .type = ros2::dds_type(kType),
          .user_data = ros2::type_user_data(kTypeHash),
          .qos = {.is_reliable = true,
                  .is_transient_local = true,
                  .depth = is_reader ? std::size_t{1000} : std::size_t{1}},
          .is_reader = is_reader};
}

void write_graph(const Guid& participant, const std::vector<NodeEntities>& nodes,
                 ros2::Buffer& out) {
  ros2::CdrWriter writer(out, kType);
  put(participant, writer);
  writer.count(nodes.size());
  for (const NodeEntities& node : nodes) {
    writer.text(node.name_space);
    writer.text(node.name);
    put(node.readers, writer);
    put(node.writers, writer);
  }
  writer.end();
}

std::vector<NodeEntities> read_graph(std::span<const std::byte> message, Guid& participant) {
  ros2::CdrReader in(message, kType);
  participant = take_guid(in);
  std::vector<NodeEntities> nodes(in.count("node_entities_info_seq", kNodeBytes));
  for (NodeEntities& node : nodes) {
    node.name_space = in.text("node_namespace");
    node.name = in.text("node_name");
    node.readers = take_guids(in, "reader_gid_seq");
    node.writers = take_guids(in, "writer_gid_seq");
  }
  in.end();
  return nodes;
}

void RosGraph::take(std::span<const std::byte> message) {
  Guid participant{};
  std::vector<NodeEntities> nodes = read_graph(message, participant);
  forget(participant);
  const std::size_t count = entities_of(nodes);
  if (nodes_.size() < kParticipantsMax && count <= kEntitiesMax - entities_) {
    nodes_[participant] = std::move(nodes);
    entities_ += count;
  }
}

void RosGraph::forget(const Guid& participant) {
  const auto found = nodes_.find(participant);
  if (found != nodes_.end()) {
    entities_ -= entities_of(found->second);
    nodes_.erase(found);
  }
}

std::string RosGraph::node_of(const Guid& endpoint) const {
  for (const auto& [participant, nodes] : nodes_) {
    for (const NodeEntities& node : nodes) {
      if (std::ranges::find(node.readers, endpoint) != node.readers.end() ||
          std::ranges::find(node.writers, endpoint) != node.writers.end()) {
        return node.name_space + (node.name_space.ends_with('/') ? "" : "/") + node.name;
      }
    }
  }
  return {};
}

}  // namespace fastcycle::dds_gateway

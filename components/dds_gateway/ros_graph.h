#pragma once

#include <map>
#include <string>
#include <vector>

#include "dds_gateway/engine.h"
#include "ros2/buffer.h"

namespace fastcycle::dds_gateway {

/// The contents of one participant's `ros_discovery_info`: which of its readers and writers belong
/// to which node, so that the tools of ROS 2 list them.
struct NodeEntities {
  std::string name_space = "/";
  std::string name;
  std::vector<Guid> readers;
  std::vector<Guid> writers;
};

/// The endpoint of that topic: reliable, and kept for late joiners.
[[nodiscard]] Endpoint graph_endpoint(bool is_reader);

/// Serialized, as `rmw_dds_common/msg/ParticipantEntitiesInfo`.
void write_graph(const Guid& participant, const std::vector<NodeEntities>& nodes,
                 ros2::Buffer& out);

/// The inverse; sets `participant` to the sender.
///
/// @errors  `ros2::CdrError`
[[nodiscard]] std::vector<NodeEntities> read_graph(std::span<const std::byte> message,
                                                   Guid& participant);

/// The nodes announced by others.
///
/// @threads  Confined.
class RosGraph {
 public:
  /// Handles a message of `ros_discovery_info`. Ignores what exceeds 65,536 readers and writers of
  /// all nodes: anyone in the network may send such messages.
  ///
  /// @errors  `ros2::CdrError`
  void take(std::span<const std::byte> message);
  /// Removes a participant that has left.
  void forget(const Guid& participant);
  /// The node that a reader or writer belongs to, as `/name`; empty if unknown.
  [[nodiscard]] std::string node_of(const Guid& endpoint) const;

 private:
  static constexpr std::size_t kParticipantsMax = 4096;
  static constexpr std::size_t kEntitiesMax = 65'536;
  std::map<Guid, std::vector<NodeEntities>> nodes_;
  std::size_t entities_ = 0;  // Of all of them.
};

}  // namespace fastcycle::dds_gateway

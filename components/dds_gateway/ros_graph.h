#pragma once

#include <map>
#include <string>
#include <vector>

#include "dds_gateway/engine.h"
#include "ros2/buffer.h"

namespace fastcycle::dds_gateway {

/// What one participant says on `ros_discovery_info`: which of its readers and writers belong to
/// which node, so that the tools of ROS 2 list them.
struct NodeEntities {
  std::string name_space = "/";
  std::string name;
  std::vector<Guid> readers;
  std::vector<Guid> writers;
};

/// The topic itself: reliable, and kept for who comes later.
[[nodiscard]] Endpoint graph_endpoint(bool is_reader);

/// Serialized, as `rmw_dds_common/msg/ParticipantEntitiesInfo`.
void write_graph(const Guid& participant, const std::vector<NodeEntities>& nodes,
                 ros2::Buffer& out);

/// The other way; `participant` is set to who says it.
///
/// @errors  `ros2::CdrError`
[[nodiscard]] std::vector<NodeEntities> read_graph(std::span<const std::byte> message,
                                                   Guid& participant);

/// The nodes that others say they have.
///
/// @threads  Confined.
class RosGraph {
 public:
  /// Takes what came on `ros_discovery_info`. What would be more than 65,536 readers and writers of
  /// all nodes is left out: whoever is in the network may send such messages.
  ///
  /// @errors  `ros2::CdrError`
  void take(std::span<const std::byte> message);
  /// Forgets a participant that has gone.
  void forget(const Guid& participant);
  /// The node that a reader or writer belongs to, as `/name`; empty if nobody has said so.
  [[nodiscard]] std::string node_of(const Guid& endpoint) const;

 private:
  static constexpr std::size_t kParticipantsMax = 4096;
  static constexpr std::size_t kEntitiesMax = 65'536;
  std::map<Guid, std::vector<NodeEntities>> nodes_;
  std::size_t entities_ = 0;  // Of all of them.
};

}  // namespace fastcycle::dds_gateway

#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "dds_gateway/engine.h"
#include "dds_gateway/ros_graph.h"

namespace fastcycle::dds_gateway {

/// User data that marks the doctor's own participants, which are not reported.
inline constexpr const char* kDoctorUserData = "enclave=/;fastcycle_doctor=1;";

/// A discovered participant.
struct FoundParticipant {
  Guid guid{};
  std::string user_data;
};

/// A discovered reader or writer.
struct FoundEndpoint {
  Guid guid{};
  Guid participant{};
  Endpoint endpoint;
  std::string node;  ///< ROS 2 node: `/lidar_driver`; empty if unknown.
};

/// The participants and endpoints of a domain, as one participant discovers them, with the nodes
/// that others announce. At most 4096 participants and 16,384 readers and writers are kept.
///
/// @threads  Confined.
class Picture {
 public:
  void take(const Discovery& discovery);
  /// A message of `ros_discovery_info`; an invalid one is ignored.
  void take_graph(std::span<const std::byte> message);

  [[nodiscard]] std::vector<FoundParticipant> participants() const;
  /// Ordered by topic, writers first.
  [[nodiscard]] std::vector<FoundEndpoint> endpoints() const;
  /// Whether it is a participant of any doctor.
  [[nodiscard]] bool is_doctor(const Guid& participant) const;

 private:
  std::map<Guid, FoundParticipant> participants_;
  std::map<Guid, FoundEndpoint> endpoints_;
  RosGraph graph_;
};

}  // namespace fastcycle::dds_gateway

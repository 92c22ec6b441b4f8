#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "dds_gateway/engine.h"
#include "dds_gateway/ros_graph.h"

namespace fastcycle::dds_gateway {

/// What the participants of the doctor itself say of themselves; they are not told of.
inline constexpr const char* kDoctorUserData = "enclave=/;fastcycle_doctor=1;";

/// A participant that was found.
struct FoundParticipant {
  Guid guid{};
  std::string user_data;
};

/// A reader or a writer that was found.
struct FoundEndpoint {
  Guid guid{};
  Guid participant{};
  Endpoint endpoint;
  std::string node;  ///< Of ROS 2: `/lidar_driver`; empty if nobody has said so.
};

/// Who is there, as one participant finds it out: what it discovers, and what others say of their
/// nodes. At most 4096 participants and 16,384 readers and writers are kept.
///
/// @threads  Confined.
class Picture {
 public:
  void take(const Discovery& discovery);
  /// A message of `ros_discovery_info`; one that is none is left out.
  void take_graph(std::span<const std::byte> message);

  [[nodiscard]] std::vector<FoundParticipant> participants() const;
  /// In the order of their topics, writers first.
  [[nodiscard]] std::vector<FoundEndpoint> endpoints() const;
  /// Whether it is a participant of a doctor, this one's or another's.
  [[nodiscard]] bool is_doctor(const Guid& participant) const;

 private:
  std::map<Guid, FoundParticipant> participants_;
  std::map<Guid, FoundEndpoint> endpoints_;
  RosGraph graph_;
};

}  // namespace fastcycle::dds_gateway

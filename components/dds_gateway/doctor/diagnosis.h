#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dds_gateway/doctor/host.h"
#include "dds_gateway/doctor/listener.h"
#include "dds_gateway/doctor/picture.h"
#include "dds_gateway/doctor/round_trip.h"

namespace fastcycle::dds_gateway {

/// Everything observed about a domain and this machine.
struct Observation {
  std::uint32_t domain = 0;
  std::string interface;  ///< The requested one; empty: the engine chose.
  bool is_secured = false;
  std::chrono::seconds watched{};
  std::map<std::string, std::string> environment = {};  ///< Relevant to DDS and ROS 2.

  std::vector<LocalInterface> interfaces = {};
  std::map<std::string, bool> multicast_returns = {};  ///< By interface: those tested.
  std::optional<std::uint64_t> receive_buffer_max = {};
  std::map<std::uint32_t, std::size_t> domains_in_use = {};  ///< Before the doctor joined.

  std::vector<ReceivedAnnouncement> announcements = {};
  std::vector<FoundParticipant> participants = {};
  std::vector<FoundEndpoint> endpoints = {};
  std::optional<RoundTripResult> round_trip = {};
};

/// `kAdvice`: may be improved; `kProblem`: prevents messages from being delivered.
enum class Level : std::uint8_t { kFine, kAdvice, kProblem };

/// Result of one check.
struct Finding {
  std::string name;
  Level level = Level::kFine;
  std::string found;
  std::string why = {};     ///< What it means; empty if all is fine.
  std::string remedy = {};  ///< How to fix it.
};

/// The environment variables recorded in `Observation`.
[[nodiscard]] const std::vector<const char*>& variables_of_interest();

/// The findings, the worst first.
[[nodiscard]] std::vector<Finding> diagnose(const Observation& seen);

/// Why no message passes from `writer` to `reader` of a topic, with the settings of both sides;
/// none if messages do.
[[nodiscard]] std::optional<Finding> trouble_between(const FoundEndpoint& writer,
                                                     const FoundEndpoint& reader);

/// Display name of an endpoint's owner: its node, else its participant.
[[nodiscard]] std::string name_of(const FoundEndpoint& endpoint);
/// `/points` for `rt/points`.
[[nodiscard]] std::string topic_of(const Endpoint& endpoint);
/// The ROS type of a DDS type name: `sensor_msgs/msg/Imu`.
[[nodiscard]] std::string type_of(const Endpoint& endpoint);
[[nodiscard]] std::string text_of(const Guid& participant);

}  // namespace fastcycle::dds_gateway

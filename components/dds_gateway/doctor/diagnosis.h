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

/// All that was seen of a domain and of this machine.
struct Observation {
  std::uint32_t domain = 0;
  std::string interface;  ///< That was asked for; empty: the engine chose.
  bool is_secured = false;
  std::chrono::seconds watched{};
  std::map<std::string, std::string> environment = {};  ///< What of it concerns DDS and ROS 2.

  std::vector<LocalInterface> interfaces = {};
  std::map<std::string, bool> multicast_returns = {};  ///< By interface: those that were tried.
  std::optional<std::uint64_t> receive_buffer_max = {};
  std::map<std::uint32_t, std::size_t> domains_in_use = {};  ///< Before the doctor came.

  std::vector<Heard> heard = {};
  std::vector<FoundParticipant> participants = {};
  std::vector<FoundEndpoint> endpoints = {};
  std::optional<RoundTripResult> round_trip = {};
};

/// `kAdvice` makes it better; because of a `kProblem` messages do not pass.
enum class Level : std::uint8_t { kFine, kAdvice, kProblem };

/// One thing that was looked at.
struct Finding {
  std::string name;
  Level level = Level::kFine;
  std::string found;
  std::string why = {};     ///< What it means; none if all is fine.
  std::string remedy = {};  ///< What changes it.
};

/// The variables of the environment that `Observation` has.
[[nodiscard]] const std::vector<const char*>& variables_of_interest();

/// What is to be said of it, the worst first.
[[nodiscard]] std::vector<Finding> diagnose(const Observation& seen);

/// Of two ends of a topic why no message passes from `writer` to `reader`, with what both sides
/// say; none if messages do.
[[nodiscard]] std::optional<Finding> trouble_between(const FoundEndpoint& writer,
                                                     const FoundEndpoint& reader);

/// How people know who has an endpoint: its node, else its participant.
[[nodiscard]] std::string name_of(const FoundEndpoint& endpoint);
/// `/points` for `rt/points`.
[[nodiscard]] std::string topic_of(const Endpoint& endpoint);
/// `sensor_msgs/msg/Imu` for its name in DDS.
[[nodiscard]] std::string type_of(const Endpoint& endpoint);
[[nodiscard]] std::string text_of(const Guid& participant);

}  // namespace fastcycle::dds_gateway

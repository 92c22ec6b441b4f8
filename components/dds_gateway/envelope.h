#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <google/protobuf/message.h>

#include "fastcycle/message.h"
#include "ros2/buffer.h"

namespace fastcycle::dds_gateway {

/// The ROS type for unconverted FastCycle messages.
inline constexpr const char* kEnvelopeType = "fastcycle_msgs/msg/Envelope";

/// One publish in a latency chain. Its names are borrowed.
struct EnvelopeHop {
  PublisherId publisher = 0;
  std::string_view component = {};
  std::string_view topic = {};
  Time begin{};
  Time published{};
};

/// The path of a latency chain from the topic `root`, which is borrowed.
struct EnvelopeTrail {
  std::string_view root = {};
  Time taken{};
  std::vector<EnvelopeHop> hops = {};
};

/// Facts sent with a message to another application. Times are by the sender's clock.
struct EnvelopeHead {
  std::uint64_t clock = 0;     ///< Id of that clock.
  std::uint64_t number = 0;    ///< Index among all messages sent on this topic.
  std::uint64_t sequence = 0;  ///< Of the publisher there.
  Time published{};
  PublisherId root = 0;  ///< Of the oldest measurement.
  Time taken{};
  std::vector<EnvelopeTrail> trails = {};
};

/// Serializes `message` into an envelope, directly into the send buffer.
///
/// @errors  `ros2::CdrError` if it is larger than protobuf can serialize.
void write_envelope(const google::protobuf::Message& message, const EnvelopeHead& head,
                    ros2::Buffer& out);

/// The inverse. `out` determines the expected type; names in the result point into `bytes`.
///
/// @errors  `ros2::CdrError`
EnvelopeHead read_envelope(std::span<const std::byte> bytes, google::protobuf::Message& out);

/// User data of such a topic's endpoint: `message=lidar.Sweep;schema=...;`, which distinguishes
/// builds with different fields.
[[nodiscard]] std::string envelope_user_data(const google::protobuf::Descriptor& message);

}  // namespace fastcycle::dds_gateway

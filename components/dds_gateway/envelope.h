#pragma once

#include <cstdint>
#include <span>
#include <string>

#include <google/protobuf/message.h>

#include "fastcycle/message.h"
#include "ros2/buffer.h"

namespace fastcycle::dds_gateway {

/// The ROS type that carries a message of FastCycle as it is.
inline constexpr const char* kEnvelopeType = "fastcycle_msgs/msg/Envelope";

/// What came with a message of another application.
struct EnvelopeHead {
  std::uint64_t sequence = 0;
  Time published{};
  Time taken{};
};

/// Serializes `message` into an envelope: its bytes are written where they are sent from.
///
/// @errors  `ros2::CdrError` if it is larger than protobuf can serialize.
void write_envelope(const google::protobuf::Message& message, const MessageInfo& info,
                    ros2::Buffer& out);

/// The other way. `out` says which type it has to be.
///
/// @errors  `ros2::CdrError`
EnvelopeHead read_envelope(std::span<const std::byte> bytes, google::protobuf::Message& out);

/// What an end of such a topic announces: `message=lidar.Sweep;schema=...;`, by which two builds
/// with different fields are told apart.
[[nodiscard]] std::string envelope_user_data(const google::protobuf::Descriptor& message);

}  // namespace fastcycle::dds_gateway

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

/// The ROS type that carries a message of FastCycle as it is.
inline constexpr const char* kEnvelopeType = "fastcycle_msgs/msg/Envelope";

/// One publish on the way of a latency chain. Its names are borrowed.
struct EnvelopeHop {
  PublisherId publisher = 0;
  std::string_view component = {};
  std::string_view topic = {};
  Time begin{};
  Time published{};
};

/// The way of a latency chain from the topic `root`, which is borrowed.
struct EnvelopeTrail {
  std::string_view root = {};
  Time taken{};
  std::vector<EnvelopeHop> hops = {};
};

/// What goes with a message from one application to another. Times are by the clock of who sends.
struct EnvelopeHead {
  std::uint64_t clock = 0;     ///< Whose clock.
  std::uint64_t number = 0;    ///< Of all that was sent on this topic.
  std::uint64_t sequence = 0;  ///< Of the publisher there.
  Time published{};
  PublisherId root = 0;  ///< Of the oldest measurement.
  Time taken{};
  std::vector<EnvelopeTrail> trails = {};
};

/// Serializes `message` into an envelope: its bytes are written where they are sent from.
///
/// @errors  `ros2::CdrError` if it is larger than protobuf can serialize.
void write_envelope(const google::protobuf::Message& message, const EnvelopeHead& head,
                    ros2::Buffer& out);

/// The other way. `out` says which type it has to be; names in what is returned are those in
/// `bytes`.
///
/// @errors  `ros2::CdrError`
EnvelopeHead read_envelope(std::span<const std::byte> bytes, google::protobuf::Message& out);

/// What an end of such a topic announces: `message=lidar.Sweep;schema=...;`, by which two builds
/// with different fields are told apart.
[[nodiscard]] std::string envelope_user_data(const google::protobuf::Descriptor& message);

}  // namespace fastcycle::dds_gateway

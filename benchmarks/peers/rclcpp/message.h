#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>

#include <std_msgs/msg/u_int8_multi_array.hpp>

#include "measure/payload.h"
#include "peers/common/run.h"

namespace fastcycle::peers {

/// A message type of every ROS 2: the stamps, then the payload, in one vector of bytes.
using RosMessage = std_msgs::msg::UInt8MultiArray;

inline Stamps stamps_of(const RosMessage& message) {
  Stamps stamps;
  std::memcpy(&stamps, message.data.data(), sizeof(stamps));
  return stamps;
}

/// A new message with its payload filled and all its stamps, to be published at once.
inline RosMessage::UniquePtr make_message(std::size_t size, std::int64_t number) {
  const std::int64_t made_ns = now_ns();
  auto message = std::make_unique<RosMessage>();
  message->data.resize(sizeof(Stamps) + size);
  measure::fill(message->data.data() + sizeof(Stamps), size, number);
  const Stamps stamps = {.number = number, .made_ns = made_ns, .sent_ns = now_ns()};
  std::memcpy(message->data.data(), &stamps, sizeof(stamps));
  return message;
}

inline void take_down(Run& run, const RosMessage& message, std::int64_t arrived_ns) {
  run.arrived(stamps_of(message), message.data.data() + sizeof(Stamps), arrived_ns);
}

}  // namespace fastcycle::peers

#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include <boost/shared_ptr.hpp>
#include <ros/message_traits.h>
#include <ros/serialization.h>

#include "peers/common/stamps.h"

namespace fastcycle::peers {

/// A message of ROS 1 without a .msg file, as in "Adapting C++ Types"
/// (wiki.ros.org/roscpp/Overview/MessagesSerializationAndAdaptingTypes). Bytes are copied as a
/// block.
struct RosPayload {
  Stamps stamps;
  std::vector<std::uint8_t> data;

  using Ptr = boost::shared_ptr<RosPayload>;
  using ConstPtr = boost::shared_ptr<const RosPayload>;
};

}  // namespace fastcycle::peers

namespace ros::message_traits {

template <>
struct MD5Sum<fastcycle::peers::RosPayload> {
  static const char* value() { return "2d5b0b5c1f8a4e0f9f3c6a7b8d9e0f11"; }  // Any that is unique.
  static const char* value(const fastcycle::peers::RosPayload& /*payload*/) { return value(); }
};

template <>
struct DataType<fastcycle::peers::RosPayload> {
  static const char* value() { return "fastcycle_peers/RosPayload"; }
  static const char* value(const fastcycle::peers::RosPayload& /*payload*/) { return value(); }
};

template <>
struct Definition<fastcycle::peers::RosPayload> {
  static const char* value() {
    return "int64 number\nint64 made_ns\nint64 sent_ns\nuint8[] data\n";
  }
  static const char* value(const fastcycle::peers::RosPayload& /*payload*/) { return value(); }
};

}  // namespace ros::message_traits

namespace ros::serialization {

/// roscpp's own serializer of vectors does not compile as C++20; this does the same.
template <>
struct Serializer<fastcycle::peers::RosPayload> {
  using Payload = fastcycle::peers::RosPayload;

  template <typename Stream>
  static void write(Stream& stream, const Payload& payload) {
    const auto length = static_cast<std::uint32_t>(payload.data.size());
    stream.next(payload.stamps.number);
    stream.next(payload.stamps.made_ns);
    stream.next(payload.stamps.sent_ns);
    stream.next(length);
    std::memcpy(stream.advance(length), payload.data.data(), length);
  }

  template <typename Stream>
  static void read(Stream& stream, Payload& payload) {
    std::uint32_t length = 0;
    stream.next(payload.stamps.number);
    stream.next(payload.stamps.made_ns);
    stream.next(payload.stamps.sent_ns);
    stream.next(length);
    const std::uint8_t* begin = stream.advance(length);
    payload.data.assign(begin, begin + length);
  }

  static std::uint32_t serializedLength(const Payload& payload) {
    return static_cast<std::uint32_t>(sizeof(payload.stamps) + sizeof(std::uint32_t) +
                                      payload.data.size());
  }
};

}  // namespace ros::serialization

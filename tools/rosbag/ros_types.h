#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

namespace fastcycle::rosbag {

/// A type of ROS messages, and what becomes of one.
struct RosType {
  std::string_view name;  ///< `sensor_msgs/msg/Imu`
  const google::protobuf::Message* prototype = nullptr;
  /// @errors  `CdrError`
  void (*convert)(std::span<const std::byte> message, google::protobuf::Message& out) = nullptr;
};

/// All that are known.
[[nodiscard]] std::span<const RosType> ros_types();

/// Null if the type is not known. `sensor_msgs/Imu` is the same as `sensor_msgs/msg/Imu`.
[[nodiscard]] const RosType* find_ros_type(std::string_view name);

}  // namespace fastcycle::rosbag

#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace fastcycle::ros2 {

/// The topic of DDS that ROS 2 uses for its topic `/points`: `rt/points`.
[[nodiscard]] std::string dds_topic(std::string_view ros_topic);
/// The topics of the service `/reset`: `rq/resetRequest`, `rr/resetReply`.
[[nodiscard]] std::string dds_request_topic(std::string_view service);
[[nodiscard]] std::string dds_reply_topic(std::string_view service);
/// The other way; none if it is no topic of ROS 2.
[[nodiscard]] std::optional<std::string> ros_topic(std::string_view dds_topic);
/// The name that `sensor_msgs/msg/Imu` has in DDS: `sensor_msgs::msg::dds_::Imu_`.
[[nodiscard]] std::string dds_type(std::string_view ros_type);
/// The other way; none if it is no type of ROS 2.
[[nodiscard]] std::optional<std::string> ros_type(std::string_view dds_type);
/// What a reader or writer announces of its type: `typehash=RIHS01_...;`.
[[nodiscard]] std::string type_user_data(std::string_view type_hash);
/// The value behind `key` in what somebody announced; empty if there is none.
[[nodiscard]] std::string_view value_of(std::string_view user_data, std::string_view key);
/// Why `name` cannot be a topic or a service of ROS 2; none if it can be.
[[nodiscard]] std::optional<std::string> mistake_of_ros_name(std::string_view name);

}  // namespace fastcycle::ros2

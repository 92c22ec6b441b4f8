#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace fastcycle::ros2 {

/// The DDS topic of the ROS 2 topic `/points`: `rt/points`.
[[nodiscard]] std::string dds_topic(std::string_view ros_topic);
/// The topics of the service `/reset`: `rq/resetRequest`, `rr/resetReply`.
[[nodiscard]] std::string dds_request_topic(std::string_view service);
[[nodiscard]] std::string dds_reply_topic(std::string_view service);
/// The inverse; none if it is no topic of ROS 2.
[[nodiscard]] std::optional<std::string> ros_topic(std::string_view dds_topic);
/// The DDS name of `sensor_msgs/msg/Imu`: `sensor_msgs::msg::dds_::Imu_`.
[[nodiscard]] std::string dds_type(std::string_view ros_type);
/// The inverse; none if it is no type of ROS 2.
[[nodiscard]] std::optional<std::string> ros_type(std::string_view dds_type);
/// The type information that a reader or writer announces: `typehash=RIHS01_...;`.
[[nodiscard]] std::string type_user_data(std::string_view type_hash);
/// The value of `key` in an endpoint's user data; empty if there is none.
[[nodiscard]] std::string_view value_of(std::string_view user_data, std::string_view key);
/// Why `name` is no valid topic or service name of ROS 2; none if it is.
[[nodiscard]] std::optional<std::string> ros_name_error(std::string_view name);

}  // namespace fastcycle::ros2

#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <google/protobuf/struct.pb.h>

#include "dds_gateway/engine.h"

namespace fastcycle::dds_gateway {

/// Reaction to a message that cannot be converted or sent; it is always counted.
enum class OnError : std::uint8_t {
  kCount,    ///< None.
  kDegrade,  ///< Degrades the component's health.
  kStop      ///< Raises a fault of the component.
};

/// A bridged topic.
struct TopicSettings {
  bool is_as_it_is = false;  ///< Unconverted, to and from another FastCycle; else ROS 2.
  std::string topic;         ///< Of FastCycle: `lidar/cloud`
  bool is_in = true;         ///< From DDS to FastCycle; else the other way.
  std::string ros;           ///< `/points`
  std::string type;          ///< `sensor_msgs/msg/PointCloud2`
  std::string message;       ///< `foxglove.PointCloud`; empty: from the mapping.
  Qos qos;
  double rate_limit_hz = 0.0;  ///< 0: none.
  std::optional<std::chrono::nanoseconds> age_max;
  OnError on_error = OnError::kCount;
};

/// A bridged service.
struct ServiceSettings {
  std::string service;  ///< Of FastCycle: `brake/release`
  bool is_in = true;    ///< ROS 2 calls this application; else the other way.
  std::string ros;      ///< `/release_brake`
  std::string type;     ///< `std_srvs/srv/SetBool`
  std::string request;  ///< `basic.Flag`; empty: from the mapping.
  std::string reply;
  std::size_t depth = 10;  ///< Maximum number of pending requests.
};

/// A parameter, or all of a component, visible to ROS 2 tools.
struct ParamSettings {
  std::string param;        ///< `limiter.limit_mps`, or `limiter.*`
  bool may_change = false;  ///< Writable, if it is tunable.
};

/// Parses the param "parameters".
///
/// @errors  As `topics_of`.
[[nodiscard]] std::vector<ParamSettings> parameters_of(
    const google::protobuf::ListValue& parameters);

/// Parses the param "services".
///
/// @errors  As `topics_of`.
[[nodiscard]] std::vector<ServiceSettings> services_of(const google::protobuf::ListValue& services);

/// Parses the param "topics".
///
/// @errors  std::invalid_argument with all errors, each with its place in the params.
[[nodiscard]] std::vector<TopicSettings> topics_of(const google::protobuf::ListValue& topics);

}  // namespace fastcycle::dds_gateway

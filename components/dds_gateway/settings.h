#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <google/protobuf/struct.pb.h>

#include "dds_gateway/engine.h"

namespace fastcycle::dds_gateway {

/// What is done when a message cannot be converted or sent; it is counted in any case.
enum class OnError : std::uint8_t {
  kCount,    ///< Nothing else.
  kDegrade,  ///< The component says that its health is degraded.
  kStop      ///< It is a fault of the component.
};

/// One topic that crosses.
struct TopicSettings {
  bool is_as_it_is = false;  ///< To and from another FastCycle; else ROS 2.
  std::string topic;         ///< Of FastCycle: `lidar/cloud`
  bool is_in = true;         ///< From DDS to FastCycle; else the other way.
  std::string ros;           ///< `/points`
  std::string type;          ///< `sensor_msgs/msg/PointCloud2`
  std::string message;       ///< `foxglove.PointCloud`; empty: what the mapping says.
  Qos qos;
  double rate_limit_hz = 0.0;  ///< 0: none.
  std::optional<std::chrono::nanoseconds> age_max;
  OnError on_error = OnError::kCount;
};

/// One service that crosses.
struct ServiceSettings {
  std::string service;  ///< Of FastCycle: `brake/release`
  bool is_in = true;    ///< ROS 2 asks, this application answers; else the other way.
  std::string ros;      ///< `/release_brake`
  std::string type;     ///< `std_srvs/srv/SetBool`
  std::string request;  ///< `basic.Flag`; empty: what the mapping says.
  std::string reply;
  std::size_t depth = 10;  ///< Requests that may be open.
};

/// A parameter, or all of a component, that tools of ROS 2 may see.
struct ParamSettings {
  std::string param;        ///< `limiter.limit_mps`, or `limiter.*`
  bool may_change = false;  ///< And change, if it is tunable.
};

/// What the params say under "parameters".
///
/// @errors  As `topics_of`.
[[nodiscard]] std::vector<ParamSettings> parameters_of(
    const google::protobuf::ListValue& parameters);

/// What the params say under "services".
///
/// @errors  As `topics_of`.
[[nodiscard]] std::vector<ServiceSettings> services_of(const google::protobuf::ListValue& services);

/// What the params say under "topics".
///
/// @errors  std::invalid_argument with all mistakes, each with its place in the params.
[[nodiscard]] std::vector<TopicSettings> topics_of(const google::protobuf::ListValue& topics);

}  // namespace fastcycle::dds_gateway

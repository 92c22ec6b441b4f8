#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "fastcycle/param_list.h"
#include "ros2/cdr.h"

namespace fastcycle::dds_gateway {

/// What ROS 2 calls the type of a parameter, with its numbers.
enum class RosParamType : std::uint8_t {
  kNotSet,
  kBool,
  kInteger,
  kDouble,
  kString,
  kByteArray,
  kBoolArray,
  kIntegerArray,
  kDoubleArray,
  kStringArray
};

/// `rcl_interfaces/msg/ParameterValue`; the alternatives are in the order of `RosParamType`.
using RosParamValue =
    std::variant<std::monostate, bool, std::int64_t, double, std::string, std::vector<std::uint8_t>,
                 std::vector<bool>, std::vector<std::int64_t>, std::vector<double>,
                 std::vector<std::string>>;

/// `rcl_interfaces/msg/Parameter`.
struct RosParam {
  std::string name;
  RosParamValue value;
};

void write(const RosParamValue& value, ros2::CdrWriter& out);
/// @errors  `ros2::CdrError`
[[nodiscard]] RosParamValue read_param_value(ros2::CdrReader& in);
/// A sequence of `rcl_interfaces/msg/Parameter`, as two of the requests have it.
///
/// @errors  `ros2::CdrError`
[[nodiscard]] std::vector<RosParam> read_params(ros2::CdrReader& in);

/// The type that a parameter of ours has for ROS 2: a text for paths, enumerations and messages,
/// of which it is their JSON.
[[nodiscard]] RosParamType ros_type_of(const ParamInfo& info);
/// Its value; not set if ROS 2 has no room for it.
[[nodiscard]] RosParamValue ros_value_of(const ParamInfo& info);
/// `value` as `ParamChange::json` of that parameter; none if it can be none of any parameter.
[[nodiscard]] std::optional<std::string> json_of(const ParamInfo& info, const RosParamValue& value);
/// `rcl_interfaces/msg/ParameterDescriptor`.
void write_descriptor(const ParamInfo& info, bool is_read_only, ros2::CdrWriter& out);

}  // namespace fastcycle::dds_gateway

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

/// Parameter types of ROS 2, with its numbers.
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
/// A sequence of `rcl_interfaces/msg/Parameter`, as in two of the requests.
///
/// @errors  `ros2::CdrError`
[[nodiscard]] std::vector<RosParam> read_params(ros2::CdrReader& in);

/// The ROS 2 type of a parameter: text for paths, enumerations and messages (as JSON).
[[nodiscard]] RosParamType ros_type_of(const ParamInfo& info);
/// Its value; not set if ROS 2 cannot represent it.
[[nodiscard]] RosParamValue ros_value_of(const ParamInfo& info);
/// `value` as `ParamChange::json` for that parameter; none if no parameter can have it.
[[nodiscard]] std::optional<std::string> json_of(const ParamInfo& info, const RosParamValue& value);
/// `rcl_interfaces/msg/ParameterDescriptor`.
void write_descriptor(const ParamInfo& info, bool is_read_only, ros2::CdrWriter& out);

}  // namespace fastcycle::dds_gateway

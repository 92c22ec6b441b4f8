#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ros2/error.h"

namespace fastcycle::ros2 {

/// Mapping of one field.
struct Rule {
  std::string to;       ///< Its path in the message, as `pose.position`; empty if it has none.
  double scale = 1.0;   ///< value in the message = scale * value of ROS + offset
  double offset = 0.0;  ///< In the unit of the message.
  std::map<std::string, std::string, std::less<>> names;  ///< ROS text to ours, for frames.
  std::optional<double> constant;  ///< Written to ROS, whatever the message contains.
};

/// How messages of a ROS type are converted to ours, and back.
struct Mapping {
  std::string ros;
  std::string message;
  /// By the field's path in ROS: `pose.pose`, `poses[].pose`. Others match by name.
  std::map<std::string, Rule, std::less<>> fields;
  /// Fields of the message that are absent if the first number of another one is -1.
  std::map<std::string, std::string, std::less<>> absent;
  std::string constants;   ///< Further contents of a message converted from ROS: JSON of protobuf.
  std::string conversion;  ///< Name of a function that converts all of it.
};

/// The mappings of one or more files; format: docs/reference/dds_gateway.md.
///
/// @threads  Compatible.
class Mappings {
 public:
  /// Adds those of the JSON text `text`, which take precedence over those added earlier; `source`
  /// is their origin, for errors.
  ///
  /// @errors  `MappingError`
  void add(std::string_view text, std::string_view source);

  /// The first mapping of a ROS type, to `message` if that is not empty; null if there is none.
  [[nodiscard]] const Mapping* find(std::string_view ros, std::string_view message = {}) const;

  [[nodiscard]] const std::vector<Mapping>& all() const { return mappings_; }

 private:
  std::vector<Mapping> mappings_;
};

}  // namespace fastcycle::ros2

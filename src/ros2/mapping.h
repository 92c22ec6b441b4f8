#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ros2/error.h"

namespace fastcycle::ros2 {

/// What becomes of one field.
struct Rule {
  std::string to;       ///< Its place in the message, as `pose.position`; empty if it has none.
  double scale = 1.0;   ///< value in the message = scale * value of ROS + offset
  double offset = 0.0;  ///< In the unit of the message.
  std::map<std::string, std::string, std::less<>> names;  ///< A text of ROS, and ours: of frames.
  std::optional<double> constant;  ///< What is written to ROS, whatever the message says.
};

/// How messages of a ROS type become messages of ours, and the other way.
struct Mapping {
  std::string ros;
  std::string message;
  /// By the field's path in ROS: `pose.pose`, `poses[].pose`. Others go by their names.
  std::map<std::string, Rule, std::less<>> fields;
  /// Fields of the message that are absent where the first number of another one is -1.
  std::map<std::string, std::string, std::less<>> absent;
  std::string constants;   ///< What else a message made of one of ROS has: JSON of protobuf.
  std::string conversion;  ///< The name of a function that does all of it.
};

/// The mappings of one or more files; docs/reference/dds_gateway.md has their form.
///
/// @threads  Compatible.
class Mappings {
 public:
  /// Adds those of the JSON text `text`, which stand before those that were added earlier;
  /// `source` is where it is from, for errors.
  ///
  /// @errors  `MappingError`
  void add(std::string_view text, std::string_view source);

  /// The first of a ROS type, and of a message if one is named; null if there is none.
  [[nodiscard]] const Mapping* find(std::string_view ros, std::string_view message = {}) const;

  [[nodiscard]] const std::vector<Mapping>& all() const { return mappings_; }

 private:
  std::vector<Mapping> mappings_;
};

}  // namespace fastcycle::ros2

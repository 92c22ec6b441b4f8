#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "ros2/error.h"

namespace fastcycle::ros2 {

/// Type of a single value.
enum class Kind : std::uint8_t {
  kBool,
  kByte,
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64,
  kText,
  kWideText,
  kMessage
};

/// Number of values of a field.
enum class Shape : std::uint8_t { kOne, kArray, kSequence, kBoundedSequence };

struct Definition;

struct Field {
  std::string name;
  Kind kind = Kind::kBool;
  Shape shape = Shape::kOne;
  std::size_t count = 0;                ///< Of an array; at most, of a bounded sequence.
  std::size_t text_max = 0;             ///< Maximum size of a text in bytes; 0: unbounded.
  const Definition* message = nullptr;  ///< Of `kMessage`.
};

struct Constant {
  std::string name;
  std::string value;
};

/// A type of ROS messages: the contents of a `.msg`, or of one half of a `.srv`.
struct Definition {
  std::string name;  ///< `sensor_msgs/msg/Imu`, `std_srvs/srv/SetBool_Request`
  std::vector<Field> fields;
  std::vector<Constant> constants;
  std::size_t least_bytes = 0;  ///< Minimum size of a message; never 0.
};

/// Placeholder field of a type without fields.
inline constexpr std::string_view kEmptyField = "structure_needs_at_least_one_member";

/// Size of a number in bytes; 0 if it is no number.
[[nodiscard]] std::size_t size_of(Kind kind);
/// Minimum size of one element.
[[nodiscard]] std::size_t least_bytes_of(const Field& field);
/// As in a `.msg`: `geometry_msgs/msg/Point[]`.
[[nodiscard]] std::string to_text(const Field& field);

/// `sensor_msgs/Imu` is the same as `sensor_msgs/msg/Imu`.
[[nodiscard]] std::string full_type_name(std::string_view name);

/// All known types: from folders with `<package>/msg/<Name>.msg`, and from texts.
///
/// @threads  Confined. Pointers to definitions stay valid as long as this lives.
class Definitions {
 public:
  /// A folder that has `<package>/msg/<Name>.msg`; the first one with a type takes precedence.
  void add_folder(std::filesystem::path folder);
  /// The folders that a ROS 2 installation names in AMENT_PREFIX_PATH.
  void add_installed();
  /// The text of the `.msg` or `.srv` `name`, used if no folder has it.
  void add_text(std::string_view name, std::string_view text);

  /// @errors  `DefinitionError`: it is missing, invalid, or contains itself.
  const Definition& find(std::string_view name);

 private:
  const Definition& find_nested(const std::string& name, std::size_t depth);
  [[nodiscard]] std::string load(const std::string& name) const;
  Definition parse(const std::string& name, std::string_view text, std::size_t depth);

  std::vector<std::filesystem::path> folders_;
  std::map<std::string, std::string, std::less<>> texts_;
  std::map<std::string, std::unique_ptr<Definition>, std::less<>> known_;
};

}  // namespace fastcycle::ros2

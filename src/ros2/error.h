#pragma once

#include <stdexcept>

namespace fastcycle::ros2 {

/// Bytes that are no message of the expected type, or a message that the type cannot hold:
/// `sensor_msgs/msg/Imu: byte 12: header.frame_id: expected 16 bytes, found 3`.
class CdrError final : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A definition of a type is missing or invalid:
/// `demo_msgs/msg/Speed: line 3: expected a type and a name, found "float32"`.
class DefinitionError final : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An invalid mapping: `sensor_msgs/msg/Imu -> motion.Imu: there is no field "speed"`.
class MappingError final : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace fastcycle::ros2

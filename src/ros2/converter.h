#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include "ros2/buffer.h"
#include "ros2/cdr.h"
#include "ros2/definition.h"
#include "ros2/mapping.h"
#include "ros2/steps.h"

namespace fastcycle::ros2 {

/// A conversion written in C++, for a type that rules for fields cannot map.
struct Conversion {
  void (*to_message)(CdrReader& in, google::protobuf::Message& out) = nullptr;
  void (*to_ros)(const google::protobuf::Message& in, CdrWriter& out) = nullptr;
};
/// By their names in mappings.
using Conversions = std::map<std::string, Conversion, std::less<>>;

/// Converts messages of one ROS type to ours, and back. The conversion of each field is determined
/// once, here; arrays of numbers and bytes are then copied once, between the serialized message and
/// our field.
///
/// @threads  Compatible.
/// @realtime Allocates as the message grows.
class Converter {
 public:
  /// `ros` and the descriptor must outlive it.
  ///
  /// @errors  `MappingError`: the mapping names a field that does not exist or does not fit; or
  ///          there is no mapping, and no field has the same name in both.
  Converter(const Definition& ros, const google::protobuf::Descriptor& ours,
            const Mappings& mappings, const Conversions& conversions);

  [[nodiscard]] const Definition& definition() const { return *ros_; }
  [[nodiscard]] const google::protobuf::Message& prototype() const { return *prototype_; }
  /// Paths of those ROS fields that have no counterpart in the message.
  [[nodiscard]] const std::vector<std::string>& unmapped() const { return unmapped_; }

  /// Clears `out` first; after an error it holds a part of the message.
  ///
  /// @errors  `CdrError`
  void to_message(std::span<const std::byte> message, google::protobuf::Message& out) const;
  /// Appends the serialized message to `out`, which should be empty.
  ///
  /// @errors  `CdrError` if the type cannot hold a value; `out` then holds a part of it.
  void to_ros(const google::protobuf::Message& message, Buffer& out) const;

 private:
  const Definition* ros_;
  const google::protobuf::Message* prototype_;
  const Conversion* conversion_ = nullptr;
  Steps steps_;
  std::unique_ptr<google::protobuf::Message> constants_;  // Null if there are none.
  std::vector<std::string> unmapped_;
};

/// The descriptor of a message whose package is loaded in this process; null if there is none.
[[nodiscard]] const google::protobuf::Descriptor* find_message(std::string_view name);

}  // namespace fastcycle::ros2

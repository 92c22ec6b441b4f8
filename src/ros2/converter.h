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

/// What is written in C++, for a type that fields alone do not map.
struct Conversion {
  void (*to_message)(CdrReader& in, google::protobuf::Message& out) = nullptr;
  void (*to_ros)(const google::protobuf::Message& in, CdrWriter& out) = nullptr;
};
/// By the names that mappings have for them.
using Conversions = std::map<std::string, Conversion, std::less<>>;

/// Makes messages of ours of those of one ROS type, and the other way. What is done with each field
/// is found out once, here; arrays of numbers and bytes are then copied once, between the
/// serialized message and the field of ours.
///
/// @threads  Compatible.
/// @realtime Allocates as the message grows.
class Converter {
 public:
  /// `ros` and the descriptor outlive it.
  ///
  /// @errors  `MappingError`: the mapping names a field that is not there or does not fit; or there
  ///          is no mapping, and not one field has the same name in both.
  Converter(const Definition& ros, const google::protobuf::Descriptor& ours,
            const Mappings& mappings, const Conversions& conversions);

  [[nodiscard]] const Definition& definition() const { return *ros_; }
  [[nodiscard]] const google::protobuf::Message& prototype() const { return *prototype_; }
  /// Paths of those fields of ROS that have no place in the message.
  [[nodiscard]] const std::vector<std::string>& unmapped() const { return unmapped_; }

  /// `out` is cleared first; after an error it holds a part of the message.
  ///
  /// @errors  `CdrError`
  void to_message(std::span<const std::byte> message, google::protobuf::Message& out) const;
  /// Adds the serialized message to `out`, which should be empty.
  ///
  /// @errors  `CdrError` if the type has no room for a value; `out` then holds a part of it.
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

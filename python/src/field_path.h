#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace google::protobuf {
class Descriptor;
class FieldDescriptor;
}  // namespace google::protobuf

namespace fastcycle::python {

/// A field on the way from a message to a value.
struct Step {
  const google::protobuf::FieldDescriptor* field = nullptr;
  int index = -1;  ///< Of an element of a repeated field; else -1.
};

/// Finds `header.taken_ns` or `objects[0].x_m` in a message type; the last step is no message.
///
/// @errors  `NotFound` with what there is; `std::invalid_argument` if `path` is none. Neither says
///          of which file and topic.
[[nodiscard]] std::vector<Step> find_field(const google::protobuf::Descriptor& type,
                                           std::string_view path);

/// The paths of all values that are in no repeated field, at most `most` of them.
[[nodiscard]] std::vector<std::string> single_fields(const google::protobuf::Descriptor& type,
                                                     std::size_t most = 4096);

}  // namespace fastcycle::python

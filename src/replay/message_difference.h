#pragma once

#include <optional>
#include <string>

namespace google::protobuf {
class Message;
}

namespace fastcycle::host {

/// Where two messages differ, and how.
struct FieldDifference {
  std::string field;     ///< A path: "objects[3].velocity.x"; empty: their bytes alone differ.
  std::string recorded;  ///< Its value there, in words; "missing" if it has none.
  std::string now;
};

/// The first difference, in the order of the fields; none if all fields are equal. Floating-point
/// numbers are compared exactly, and one NaN equals another.
[[nodiscard]] std::optional<FieldDifference> first_difference(
    const google::protobuf::Message& recorded, const google::protobuf::Message& now);

}  // namespace fastcycle::host

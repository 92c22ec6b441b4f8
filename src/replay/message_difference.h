#pragma once

#include <functional>
#include <optional>
#include <string>

namespace google::protobuf {
class Message;
}

namespace fastcycle::host {

/// One field in which two messages differ. Valid only during the call that it is given to.
class FieldDifference {
 public:
  /// "objects[3].velocity.x"
  [[nodiscard]] virtual std::string path() const = 0;
  /// The same of all elements: "objects[].velocity.x"
  [[nodiscard]] virtual std::string pattern() const = 0;
  /// The values in words; "missing" where a message has none.
  [[nodiscard]] virtual std::string recorded() const = 0;
  [[nodiscard]] virtual std::string now() const = 0;
  /// By how much the new value is more than the recorded one; none if they are no numbers, or one
  /// is not finite.
  [[nodiscard]] virtual std::optional<double> change() const = 0;

 protected:
  ~FieldDifference() = default;
};

/// Calls `visit` for each difference, in the order of the fields. Elements of repeated fields are
/// compared by their index. Floating-point numbers are compared exactly, and one NaN equals
/// another.
void for_each_difference(const google::protobuf::Message& recorded,
                         const google::protobuf::Message& now,
                         const std::function<void(const FieldDifference& difference)>& visit);

}  // namespace fastcycle::host

#pragma once

#include <functional>
#include <optional>
#include <string>

namespace google::protobuf {
class Message;
}

namespace fastcycle::host {

/// One field in which two messages differ. Valid only during the call that receives it.
class FieldDifference {
 public:
  /// "objects[3].velocity.x"
  [[nodiscard]] virtual std::string path() const = 0;
  /// The same without indices: "objects[].velocity.x"
  [[nodiscard]] virtual std::string pattern() const = 0;
  /// The values as text; "missing" if a message has none.
  [[nodiscard]] virtual std::string recorded() const = 0;
  [[nodiscard]] virtual std::string now() const = 0;
  /// The new value minus the recorded one; none if they are not numbers, or not finite.
  [[nodiscard]] virtual std::optional<double> change() const = 0;

 protected:
  ~FieldDifference() = default;
};

/// Calls `visit` for each difference, in the order of the fields. Compares elements of repeated
/// fields by index, and floating-point numbers exactly, with NaN equal to NaN.
void for_each_difference(const google::protobuf::Message& recorded,
                         const google::protobuf::Message& now,
                         const std::function<void(const FieldDifference& difference)>& visit);

}  // namespace fastcycle::host

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <google/protobuf/message.h>

#include "config/description.h"

namespace fastcycle::faults {

/// A field of a message, or of the messages in it: `pose.x_m`, `objects.speed_mps` (of each
/// object), `objects.0.speed_mps`.
///
/// @threads  Compatible.
class FieldPath {
 public:
  /// The field `text` of messages of `type`; none, and `why`, if there is no such field, or
  /// `corruption` is not applicable to it.
  static std::optional<FieldPath> find(std::string_view text,
                                       const google::protobuf::Descriptor& type,
                                       config::Corruption corruption, std::string& why);

  /// Changes the field in `message`. `bits` selects the bit to flip; `before` is the previous
  /// message, or null.
  void corrupt(google::protobuf::Message& message, config::Corruption corruption, double value,
               std::uint64_t bits, const google::protobuf::Message* before) const;

 private:
  struct Step {
    const google::protobuf::FieldDescriptor* field;
    int index;  ///< Of a repeated field; -1: all elements, or not repeated.
  };

  std::vector<Step> steps_;
};

}  // namespace fastcycle::faults

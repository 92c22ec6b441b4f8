#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/printable.h"
#include "mcap/records.h"

namespace google::protobuf {
class FieldDescriptor;
class Message;
}  // namespace google::protobuf

namespace fastcycle::archive {

using base::printable;

/// The text of a field, or of the element `index` of a repeated one. Numbers are as short as
/// possible without loss, enums are names, bytes are their size: `<7 bytes>`.
///
/// @pre  It is no message. `index` is -1 if and only if the field is not repeated.
[[nodiscard]] std::string scalar_text(const google::protobuf::Message& message,
                                      const google::protobuf::FieldDescriptor& field, int index);

/// How much of large fields is shown.
struct TextLimits {
  std::size_t elements = 5;   ///< Of a repeated field.
  std::size_t bytes = 64;     ///< Of a bytes field: a larger one is `<4194304 bytes>`.
  std::size_t letters = 400;  ///< Of a string.

  /// No limits.
  [[nodiscard]] static TextLimits none();
};

/// A field that is not shown completely.
struct Elided {
  std::string field;           ///< `points[0].data`
  std::uint64_t left_out = 0;  ///< Elements, bytes or letters.
};

/// A message as lines of text, each field that is set on one of its own, `indent` columns from the
/// left. `cut` has parts that are missing already, treated as those beyond the limits.
[[nodiscard]] std::string to_text(const google::protobuf::Message& message,
                                  const TextLimits& limits = {}, int indent = 0,
                                  const std::vector<Elided>& cut = {});

/// A message as protobuf's JSON, with the names of the schema. Parts of large fields beyond the
/// limits are missing; `elided` lists these fields, and those that are `cut` already.
///
/// @errors  `std::runtime_error` if it has no JSON, as a time stamp beyond the year 9999.
struct MessageJson {
  std::string data;
  std::vector<Elided> elided;
};
[[nodiscard]] MessageJson to_json(const google::protobuf::Message& message,
                                  const TextLimits& limits = {},
                                  const std::vector<Elided>& cut = {});

/// Bytes as hexadecimal digits, at most `limits.bytes` of them: `0a1b… 2 more`.
[[nodiscard]] std::string to_hex(mcap::Bytes bytes, const TextLimits& limits = {});

}  // namespace fastcycle::archive

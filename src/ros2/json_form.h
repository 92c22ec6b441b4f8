#pragma once

#include <cstddef>
#include <span>

#include <nlohmann/json_fwd.hpp>

#include "ros2/buffer.h"
#include "ros2/definition.h"

namespace fastcycle::ros2 {

/// A message of any type as JSON, for tests and for display: objects in the order of the fields,
/// `uint8[]` as `{"base64": "..."}`, numbers that JSON cannot represent as "NaN", "Infinity" and
/// "-Infinity".
///
/// @errors  `CdrError`
[[nodiscard]] nlohmann::ordered_json to_json(const Definition& definition,
                                             std::span<const std::byte> message);

/// The inverse; fields missing in `value` are zero or empty.
///
/// @errors  `CdrError` for a value that the type cannot hold.
void from_json(const Definition& definition, const nlohmann::ordered_json& value, Buffer& out);

}  // namespace fastcycle::ros2

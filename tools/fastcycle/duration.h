#pragma once

#include <optional>
#include <string_view>

#include "fastcycle/time.h"

namespace fastcycle::tool {

/// A duration as people write it: "500ms", "10s", "1.5s", "2min", "1h". None if it is not above
/// zero, or not a duration.
[[nodiscard]] std::optional<Duration> parse_duration(std::string_view text);

}  // namespace fastcycle::tool

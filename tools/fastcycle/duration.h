#pragma once

#include <optional>
#include <string_view>

#include "fastcycle/time.h"

namespace fastcycle::tool {

/// A span of time as people write it: "500ms", "10s", "1.5s", "2min", "1h". None if it is not above
/// zero, or nothing of the kind.
[[nodiscard]] std::optional<Duration> parse_duration(std::string_view text);

}  // namespace fastcycle::tool

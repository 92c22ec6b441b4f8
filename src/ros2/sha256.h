#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace fastcycle::ros2 {

/// SHA-256 of `text`.
[[nodiscard]] std::array<std::byte, 32> sha256(std::string_view text);

}  // namespace fastcycle::ros2

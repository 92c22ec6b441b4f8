#pragma once

#include <array>
#include <cstddef>

#include "fastcycle/log.h"

namespace fastcycle::detail {

/// What the levels of the log are called wherever people read or write them, in their order.
inline constexpr std::array<const char*, 4> kLogLevelWords{"debug", "info", "warning", "error"};

[[nodiscard]] constexpr const char* to_word(LogLevel level) noexcept {
  return kLogLevelWords[static_cast<std::size_t>(level)];
}

}  // namespace fastcycle::detail

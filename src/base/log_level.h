#pragma once

#include <array>
#include <cstddef>

#include "fastcycle/log.h"

namespace fastcycle::detail {

/// The names of the log levels in input and output, in their order.
inline constexpr std::array<const char*, 4> kLogLevelWords{"debug", "info", "warning", "error"};

[[nodiscard]] constexpr const char* to_word(LogLevel level) noexcept {
  return kLogLevelWords[static_cast<std::size_t>(level)];
}

}  // namespace fastcycle::detail

#pragma once

#include <chrono>

namespace fastcycle::tool {

// The sequence that clears a terminal line, and the period at which it is redrawn.
constexpr const char* kClearLine = "\r\x1b[K";
constexpr std::chrono::milliseconds kRedrawPeriod{500};

}  // namespace fastcycle::tool

#pragma once

#include <chrono>

namespace fastcycle::tool {

// What a line of the terminal is redrawn by, and how often.
constexpr const char* kClearLine = "\r\x1b[K";
constexpr std::chrono::milliseconds kRedrawPeriod{500};

}  // namespace fastcycle::tool

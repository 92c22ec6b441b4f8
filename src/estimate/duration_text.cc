#include "estimate/duration_text.h"

#include <chrono>

#include <fmt/format.h>

namespace fastcycle::estimate {

std::string text_of(Duration span) {
  const double ms = std::chrono::duration<double, std::milli>(span).count();
  return ms == 0     ? "0"
         : ms < 1    ? fmt::format("{:.0f} µs", ms * 1e3)
         : ms < 1000 ? fmt::format("{:.2f} ms", ms)
                     : fmt::format("{:.2f} s", ms / 1e3);
}

}  // namespace fastcycle::estimate

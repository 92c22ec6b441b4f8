#include "duration.h"

#include <array>
#include <charconv>
#include <cmath>
#include <utility>

namespace fastcycle::tool {

std::optional<Duration> parse_duration(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, double>, 6> kUnits{
      {{"ns", 1.0}, {"us", 1e3}, {"ms", 1e6}, {"s", 1e9}, {"min", 60e9}, {"h", 3600e9}}};
  double number = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, number, std::chars_format::fixed);
  if (error != std::errc()) {
    return std::nullopt;
  }
  for (const auto& [unit, unit_ns] : kUnits) {
    if (unit == std::string_view(rest, static_cast<std::size_t>(end - rest))) {
      const double ns = std::round(number * unit_ns);
      // About a century: far from where nanoseconds overflow.
      return ns >= 1.0 && ns < 3e18 ? std::optional(Duration(static_cast<std::int64_t>(ns)))
                                    : std::nullopt;
    }
  }
  return std::nullopt;
}

}  // namespace fastcycle::tool

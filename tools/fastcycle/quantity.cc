#include "quantity.h"

#include <array>
#include <charconv>
#include <cmath>
#include <ctime>
#include <utility>

#include <fmt/format.h>

#include "duration.h"

namespace fastcycle::tool {
namespace {

constexpr std::uint64_t kNsPerSecond = 1'000'000'000;

}  // namespace

std::string bytes_text(std::uint64_t bytes) {
  constexpr std::array<std::pair<double, const char*>, 4> kUnits{
      {{1e12, "TB"}, {1e9, "GB"}, {1e6, "MB"}, {1e3, "kB"}}};
  const auto number = static_cast<double>(bytes);
  for (const auto& [unit, name] : kUnits) {
    if (number >= unit) {
      return fmt::format("{:.1f} {}", number / unit, name);
    }
  }
  return fmt::format("{} B", bytes);
}

std::optional<std::uint64_t> parse_bytes(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, double>, 9> kUnits{{{"B", 1.0},
                                                                       {"kB", 1e3},
                                                                       {"KB", 1e3},
                                                                       {"MB", 1e6},
                                                                       {"GB", 1e9},
                                                                       {"TB", 1e12},
                                                                       {"KiB", 1024.0},
                                                                       {"MiB", 1024.0 * 1024},
                                                                       {"GiB", 1024.0 * 1048576}}};
  double number = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, number, std::chars_format::fixed);
  if (error != std::errc()) {
    return std::nullopt;
  }
  for (const auto& [unit, factor] : kUnits) {
    if (unit == std::string_view(rest, static_cast<std::size_t>(end - rest))) {
      const double bytes = std::round(number * factor);
      return bytes >= 1.0 && bytes < 9e18 ? std::optional(static_cast<std::uint64_t>(bytes))
                                          : std::nullopt;
    }
  }
  return std::nullopt;
}

std::optional<std::uint64_t> parse_offset(std::string_view text) {
  if (text == "0s") {
    return 0;
  }
  const std::optional<Duration> duration = parse_duration(text);
  return duration ? std::optional(static_cast<std::uint64_t>(duration->count())) : std::nullopt;
}

std::string utc_text(std::uint64_t time_ns) {
  const auto seconds = static_cast<std::time_t>(time_ns / kNsPerSecond);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:09}Z", parts.tm_year + 1900,
                     parts.tm_mon + 1, parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec,
                     time_ns % kNsPerSecond);
}

std::string seconds_text(std::uint64_t duration_ns) {
  const std::uint64_t below = duration_ns % kNsPerSecond;
  const std::uint64_t seconds = duration_ns / kNsPerSecond;
  return below % 1000 == 0 ? fmt::format("{}.{:06} s", seconds, below / 1000)
                           : fmt::format("{}.{:09} s", seconds, below);
}

}  // namespace fastcycle::tool

#include "live/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "archive/message_text.h"

namespace fastcycle::tool::live {
namespace {

/// How many columns of a terminal `text` takes, unless it has letters of double width.
std::size_t width_of(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) != 0x80U; }));
}

bool is_number(std::string_view cell) {
  return cell.empty() || cell == "-" || (cell.front() >= '0' && cell.front() <= '9') ||
         (cell.size() > 1 && cell.front() == '-' && cell[1] >= '0' && cell[1] <= '9');
}

/// Three digits that count, without a power of ten.
std::string three_digits(double number) {
  const double size = std::abs(number);
  return fmt::format("{:.{}f}", number, size < 9.995 ? 2 : size < 99.95 ? 1 : 0);
}

}  // namespace

std::string table_text(const std::vector<std::vector<std::string>>& rows, std::string_view indent) {
  std::vector<std::size_t> widths;
  std::vector<bool> is_right;
  std::vector<std::vector<std::string>> cells;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    is_right.resize(widths.size(), true);
    auto& printed = cells.emplace_back();
    for (std::size_t i = 0; i < row.size(); ++i) {
      printed.push_back(archive::printable(row[i]));
      widths[i] = std::max(widths[i], width_of(printed[i]));
      is_right[i] = is_right[i] && (cells.size() == 1 || is_number(printed[i]));
    }
  }
  std::string text;
  for (const auto& row : cells) {
    std::string line(indent);
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string fill(widths[i] - width_of(row[i]), ' ');
      line += (i == 0 ? "" : "  ") + (is_right[i] ? fill + row[i] : row[i] + fill);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

std::string span_text(double ns) {
  constexpr std::array<std::pair<double, const char*>, 3> kUnits{
      {{1e9, "s"}, {1e6, "ms"}, {1e3, "µs"}}};
  for (const auto& [unit, name] : kUnits) {
    if (std::abs(ns) >= unit * 0.9995) {
      return three_digits(ns / unit) + " " + name;
    }
  }
  return fmt::format("{:.0f} ns", ns);
}

std::string uptime_text(std::uint64_t ns) {
  const std::uint64_t seconds = ns / 1'000'000'000;
  constexpr std::uint64_t kMinute = 60;
  constexpr std::uint64_t kHour = 60 * kMinute;
  constexpr std::uint64_t kDay = 24 * kHour;
  if (seconds < kMinute) {
    return fmt::format("{} s", seconds);
  }
  if (seconds < kHour) {
    return fmt::format("{} min {} s", seconds / kMinute, seconds % kMinute);
  }
  if (seconds < kDay) {
    return fmt::format("{} h {} min", seconds / kHour, seconds % kHour / kMinute);
  }
  return fmt::format("{} d {} h", seconds / kDay, seconds % kDay / kHour);
}

std::string rate_text(double hz) {
  if (hz <= 0.0) {
    return "-";
  }
  return hz < 1000.0 ? three_digits(hz) + " Hz" : fmt::format("{:.0f} Hz", hz);
}

std::string count_text(std::uint64_t count, std::string_view one) {
  return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

}  // namespace fastcycle::tool::live

#include "top/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "base/printable.h"
#include "base/utf8.h"

namespace fastcycle::tool::top {
namespace {

struct Range {
  char32_t first;
  char32_t last;
};

// Combining marks: the common blocks of Unicode 15.
constexpr std::array kMarks{
    Range{0x0300, 0x036f},  Range{0x0483, 0x0489}, Range{0x0591, 0x05bd}, Range{0x0610, 0x061a},
    Range{0x064b, 0x065f},  Range{0x0900, 0x0902}, Range{0x093c, 0x093c}, Range{0x0941, 0x0948},
    Range{0x0e31, 0x0e31},  Range{0x0e34, 0x0e3a}, Range{0x0e47, 0x0e4e}, Range{0x1ab0, 0x1aff},
    Range{0x1dc0, 0x1dff},  Range{0x200d, 0x200d}, Range{0x20d0, 0x20ff}, Range{0x302a, 0x302d},
    Range{0x3099, 0x309a},  Range{0xfe00, 0xfe0f}, Range{0xfe20, 0xfe2f}, Range{0x1f3fb, 0x1f3ff},
    Range{0xe0100, 0xe01ef}};

// Wide characters (East Asian Width W and F, and emoji).
constexpr std::array kWide{
    Range{0x1100, 0x115f},   Range{0x231a, 0x231b},   Range{0x2e80, 0x303e},
    Range{0x3041, 0x33ff},   Range{0x3400, 0x4dbf},   Range{0x4e00, 0x9fff},
    Range{0xa000, 0xa4cf},   Range{0xa960, 0xa97f},   Range{0xac00, 0xd7a3},
    Range{0xf900, 0xfaff},   Range{0xfe10, 0xfe19},   Range{0xfe30, 0xfe6f},
    Range{0xff00, 0xff60},   Range{0xffe0, 0xffe6},   Range{0x1f300, 0x1f64f},
    Range{0x1f680, 0x1f6ff}, Range{0x1f900, 0x1f9ff}, Range{0x1fa70, 0x1faff},
    Range{0x20000, 0x3fffd}};

// Printable characters of unknown width.
constexpr std::array kUndrawn{Range{0x200c, 0x200c}, Range{0xe000, 0xf8ff}};

template <std::size_t kSize>
bool is_in(const std::array<Range, kSize>& ranges, char32_t point) {
  return std::any_of(ranges.begin(), ranges.end(),
                     [&](Range range) { return point >= range.first && point <= range.last; });
}

std::string joined(const std::vector<Glyph>& glyphs, std::size_t first, std::size_t last) {
  std::string text;
  for (std::size_t i = first; i < last; ++i) {
    text += glyphs[i].bytes;
  }
  return text;
}

/// Three digits of `number`, which is below 999.5.
std::string three_digits(double number) {
  return number < 9.995   ? fmt::format("{:.2f}", number)
         : number < 99.95 ? fmt::format("{:.1f}", number)
                          : fmt::format("{:.0f}", number);
}

/// `number` in the first unit in which it has at most three digits before the point.
std::string scaled(double number, std::initializer_list<std::pair<double, const char*>> units) {
  for (const auto& [unit, name] : units) {
    if (number / unit < 999.5) {
      return three_digits(number / unit) + name;
    }
  }
  const auto& [unit, name] = *(units.end() - 1);
  return fmt::format("{:.0f}{}", number / unit, name);
}

}  // namespace

std::vector<Glyph> glyphs_of(std::string_view text) {
  std::vector<Glyph> glyphs;
  while (!text.empty()) {
    const std::size_t length = base::utf8_length(text);
    const std::size_t size = std::max<std::size_t>(length, 1);
    const char32_t point = length == 0 ? 0 : base::code_point(text, length);
    if (!base::is_printable(point) || is_in(kUndrawn, point)) {
      glyphs.push_back({"?", 1});
    } else if (!is_in(kMarks, point)) {
      glyphs.push_back({std::string(text.substr(0, size)), is_in(kWide, point) ? 2 : 1});
    } else if (!glyphs.empty()) {
      glyphs.back().bytes += text.substr(0, size);
    }
    text.remove_prefix(size);
  }
  return glyphs;
}

int width_of(std::string_view text) {
  int width = 0;
  for (const Glyph& glyph : glyphs_of(text)) {
    width += glyph.width;
  }
  return width;
}

std::string shortened(std::string_view text, int width) {
  const std::vector<Glyph> glyphs = glyphs_of(text);
  int total = 0;
  std::size_t fitting = 0;  // The part that leaves room for the mark.
  for (std::size_t i = 0; i < glyphs.size(); ++i) {
    total += glyphs[i].width;
    fitting = total < width ? i + 1 : fitting;
  }
  if (total <= width) {
    return joined(glyphs, 0, glyphs.size());
  }
  return width <= 0 ? "" : joined(glyphs, 0, fitting) + "…";
}

std::string shortened_name(std::string_view name, int width) {
  const std::vector<Glyph> glyphs = glyphs_of(name);
  int total = 0;
  for (const Glyph& glyph : glyphs) {
    total += glyph.width;
  }
  if (total <= width || width < 5) {
    return shortened(name, width);
  }
  std::size_t head = 0;
  int left = width - 1;
  for (int taken = 0; head < glyphs.size() && taken + glyphs[head].width <= (width - 1) / 3;) {
    taken += glyphs[head].width;
    left -= glyphs[head].width;
    ++head;
  }
  std::size_t tail = glyphs.size();
  while (tail > head && glyphs[tail - 1].width <= left) {
    left -= glyphs[--tail].width;
  }
  return joined(glyphs, 0, head) + "…" + joined(glyphs, tail, glyphs.size());
}

std::string time_text(double ns) {
  if (!(ns > 0)) {
    return "0";
  }
  if (ns < 999.5) {
    return fmt::format("{:.0f}ns", ns);
  }
  if (ns < 120e9) {
    return scaled(ns, {{1e3, "µs"}, {1e6, "ms"}, {1e9, "s"}});
  }
  return ns < 7200e9 ? fmt::format("{:.1f}m", ns / 60e9) : fmt::format("{:.1f}h", ns / 3600e9);
}

std::string rate_text(double hz) {
  if (!(hz > 0)) {
    return "0";
  }
  return hz < 99.95    ? (hz < 0.095 ? fmt::format("{:.2f}", hz) : fmt::format("{:.1f}", hz))
         : hz < 9999.5 ? fmt::format("{:.0f}", hz)
                       : scaled(hz, {{1e3, "k"}, {1e6, "M"}, {1e9, "G"}});
}

std::string size_text(double bytes) {
  if (!(bytes > 0)) {
    return "0";
  }
  return bytes < 999.5 ? fmt::format("{:.0f}B", bytes)
                       : scaled(bytes, {{1e3, "kB"}, {1e6, "MB"}, {1e9, "GB"}, {1e12, "TB"}});
}

std::string count_text(std::uint64_t count) {
  const auto number = static_cast<double>(count);
  return count < 100'000 ? fmt::format("{}", count)
                         : scaled(number, {{1e3, "k"}, {1e6, "M"}, {1e9, "G"}, {1e12, "T"}});
}

std::string percent_text(double percent) {
  return percent < 99.95 ? fmt::format("{:.1f}", std::max(percent, 0.0))
                         : fmt::format("{:.0f}", percent);
}

std::string clock_text(double seconds) {
  const auto whole = static_cast<long long>(std::max(seconds, 0.0));
  const std::string day = whole >= 86400 ? fmt::format("{}d ", whole / 86400) : "";
  return fmt::format("{}{}:{:02}:{:02}", day, whole / 3600 % 24, whole / 60 % 60, whole % 60);
}

}  // namespace fastcycle::tool::top

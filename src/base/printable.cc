#include "base/printable.h"

#include <algorithm>
#include <array>
#include <iterator>

#include <fmt/format.h>

#include "base/utf8.h"

namespace fastcycle::base {
namespace {

struct Range {
  char32_t first;
  char32_t last;
};

constexpr std::array kUnprintable{
    Range{0x00, 0x1f},        // C0
    Range{0x7f, 0x9f},        // DEL and C1
    Range{0x061c, 0x061c},    // Arabic letter mark
    Range{0x200b, 0x200b},    // Zero width space
    Range{0x200e, 0x200f},    // Left-to-right and right-to-left mark
    Range{0x2028, 0x202e},    // Line and paragraph separator, embeddings and overrides
    Range{0x2060, 0x206f},    // Invisible operators, isolates
    Range{0xfeff, 0xfeff},    // Zero width no-break space
    Range{0xfff9, 0xfffb},    // Interlinear annotation
    Range{0xe0000, 0xe007f},  // Tags
};

/// Calls `escape(bytes, point)` for what is not printable and not in `kept`, where `bytes` are no
/// UTF-8 if `point` is 0xFFFD and they are one byte.
template <typename Escape>
std::string escaped(std::string_view text, std::string_view kept, const Escape& escape) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    const char32_t point = length == 0 ? 0xFFFD : code_point(text, length);
    const std::string_view bytes = text.substr(0, std::max<std::size_t>(length, 1));
    if (length != 0 && (is_printable(point) || kept.find(bytes) != std::string_view::npos)) {
      result += bytes;
    } else {
      escape(result, bytes, point);
    }
    text.remove_prefix(bytes.size());
  }
  return result;
}

void append_bytes(std::string& result, std::string_view bytes, char32_t /*point*/) {
  for (const char byte : bytes) {
    fmt::format_to(std::back_inserter(result), "\\x{:02x}", static_cast<unsigned char>(byte));
  }
}

void append_json(std::string& result, std::string_view /*bytes*/, char32_t point) {
  const auto append = [&](unsigned unit) {
    fmt::format_to(std::back_inserter(result), "\\u{:04x}", unit);
  };
  if (point < 0x10000) {
    append(point);
  } else {
    append(0xD7C0 + (point >> 10U));
    append(0xDC00 + (point & 0x3FFU));
  }
}

constexpr std::string_view kLineEnds = "\n\t";

}  // namespace

bool is_printable(char32_t point) noexcept {
  return std::ranges::none_of(
      kUnprintable, [&](Range range) { return point >= range.first && point <= range.last; });
}

std::string printable(std::string_view text) {
  return escaped(text, "", append_bytes);
}

std::string on_one_line(std::string text) {
  std::ranges::replace_if(text, [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
  return text;
}

std::string printable_lines(std::string_view text) {
  return escaped(text, kLineEnds, append_bytes);
}

std::string printable_json(std::string_view json) {
  return escaped(json, kLineEnds, append_json);
}

}  // namespace fastcycle::base

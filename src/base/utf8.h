#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

namespace fastcycle::base {

/// The bytes of the character that `text` begins with; 0 if these are no UTF-8, or if there is
/// none.
[[nodiscard]] inline std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned lead = text.empty() ? 0xFF : byte(0);
  const std::size_t length = lead < 0x80                    ? 1
                             : lead >= 0xC2 && lead <= 0xDF ? 2
                             : lead >= 0xE0 && lead <= 0xEF ? 3
                             : lead >= 0xF0 && lead <= 0xF4 ? 4
                                                            : 0;
  if (length == 0 || length > text.size()) {
    return 0;
  }
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) {
      return 0;
    }
  }
  // Longer than needed, half of a pair, or beyond the last character.
  const bool is_wrong = (lead == 0xE0 && byte(1) < 0xA0) || (lead == 0xED && byte(1) >= 0xA0) ||
                        (lead == 0xF0 && byte(1) < 0x90) || (lead == 0xF4 && byte(1) >= 0x90);
  return is_wrong ? 0 : length;
}

/// The code point of the character that `text` begins with, whose `utf8_length` is `length` and not
/// 0.
[[nodiscard]] inline char32_t code_point(std::string_view text, std::size_t length) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  char32_t point = length == 1 ? byte(0) : byte(0) & (0xFFU >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    point = (point << 6U) | (byte(i) & 0x3FU);
  }
  return point;
}

[[nodiscard]] inline bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    if (length == 0) {
      return false;
    }
    text.remove_prefix(length);
  }
  return true;
}

/// `text` itself if it is UTF-8, else with '?' in place of each byte that is not ASCII, as string
/// fields require.
[[nodiscard]] inline std::string to_utf8(std::string_view text) {
  std::string result(text);
  if (!is_utf8(result)) {
    std::ranges::replace_if(
        result, [](char c) { return (static_cast<unsigned char>(c) & 0x80U) != 0; }, '?');
  }
  return result;
}

}  // namespace fastcycle::base

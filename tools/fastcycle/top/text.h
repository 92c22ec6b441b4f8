#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::tool::top {

/// One character as a terminal shows it, with its combining marks.
struct Glyph {
  std::string bytes;  ///< UTF-8.
  int width = 1;      ///< Columns: 1, or 2 for wide characters.
};

/// The characters of `text`. Those unsafe for a terminal (control characters, invalid UTF-8, marks
/// that change the writing direction) are shown as `?`.
[[nodiscard]] std::vector<Glyph> glyphs_of(std::string_view text);

/// The number of terminal columns that `text` takes.
[[nodiscard]] int width_of(std::string_view text);

/// `text` in at most `width` columns: a longer one is cut at its end and marked with `…`.
[[nodiscard]] std::string shortened(std::string_view text, int width);
/// The same for names of many parts, which differ at their end: the middle is left out.
[[nodiscard]] std::string shortened_name(std::string_view name, int width);

// Numbers for display, in at most six columns.

/// `123ns`, `12.3µs`, `1.23ms`, `45.6s`, `12.3m`, `1.2h`
[[nodiscard]] std::string time_text(double ns);
/// `0.5`, `12.3`, `1234`, `12.3k`, `1.23M`: times a second.
[[nodiscard]] std::string rate_text(double hz);
/// `123B`, `12.3kB`, `1.23MB`, in powers of ten.
[[nodiscard]] std::string size_text(double bytes);
/// `0`, `1234`, `123k`, `1.23M`
[[nodiscard]] std::string count_text(std::uint64_t count);
/// `0.1`, `12.3`, `456`
[[nodiscard]] std::string percent_text(double percent);

/// `1:02:03`, and `2d 1:02:03` for a day or more.
[[nodiscard]] std::string clock_text(double seconds);

}  // namespace fastcycle::tool::top

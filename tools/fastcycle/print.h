#pragma once

#include <cstdio>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace fastcycle::tool {

// All that the program prints for people goes through here, so that nothing in it steers a
// terminal: what components, files and other programs say may contain anything. Only escape
// sequences of our own are written past it (redrawn_line.h, top/terminal.h).

/// Prints `text` with what is not printable in it shown as `\x1b`; line ends stay.
void print_text(std::FILE* stream, std::string_view text);

/// The same, of a format and what it formats.
template <typename... Args>
void print_to(std::FILE* stream, fmt::format_string<Args...> format, Args&&... args) {
  print_text(stream, fmt::vformat(format, fmt::make_format_args(args...)));
}

}  // namespace fastcycle::tool

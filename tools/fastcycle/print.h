#pragma once

#include <cstdio>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace fastcycle::tool {

// All output for people goes through here, so that none of it controls the terminal: text from
// components, files and other programs may contain any bytes. Only our own escape sequences bypass
// it (redrawn_line.h, top/terminal.h).

/// Prints `text` with unprintable bytes shown as `\x1b`; line ends are kept.
void print_text(std::FILE* stream, std::string_view text);

/// The same, with a format string and arguments.
template <typename... Args>
void print_to(std::FILE* stream, fmt::format_string<Args...> format, Args&&... args) {
  print_text(stream, fmt::vformat(format, fmt::make_format_args(args...)));
}

}  // namespace fastcycle::tool

#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::tool::live {

/// A table as lines of text, with two blanks between columns. Columns whose cells, except the first
/// row's, all begin with a digit or are "-" are right-aligned. Text from the application is made
/// printable.
[[nodiscard]] std::string table_text(const std::vector<std::vector<std::string>>& rows,
                                     std::string_view indent = "");

/// `850 ns`, `12.3 µs`, `4.56 ms`, `1.23 s`: three digits, for people.
[[nodiscard]] std::string span_text(double ns);

/// `42 s`, `5 min 3 s`, `2 h 4 min`, `3 d 1 h`: an uptime.
[[nodiscard]] std::string uptime_text(std::uint64_t ns);

/// `99.8 Hz`; `-` for none.
[[nodiscard]] std::string rate_text(double hz);

/// `1 message`, `2 messages`.
[[nodiscard]] std::string count_text(std::uint64_t count, std::string_view one);

}  // namespace fastcycle::tool::live

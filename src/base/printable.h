#pragma once

#include <string>
#include <string_view>

namespace fastcycle::base {

// Text from components, files and other programs may contain anything. All output to terminals
// passes one of these functions, so that no such text can move the cursor, set colours or the
// title, or change the displayed order of text.

/// Whether a terminal shows `point` as a character, or ignores it harmlessly: it is no control
/// character (C0, DEL, C1), changes no direction of text, and is no invisible separator or tag.
[[nodiscard]] bool is_printable(char32_t point) noexcept;

/// `text` on one line: the bytes of characters that are not printable, line ends included, and
/// bytes that are no UTF-8 are shown as `\x1b`.
[[nodiscard]] std::string printable(std::string_view text);

/// `text` on one line, its control characters as blanks.
[[nodiscard]] std::string on_one_line(std::string text);

/// As `printable`, for a text of several lines: line ends and tabs are kept.
[[nodiscard]] std::string printable_lines(std::string_view text);

/// As `printable_lines`, for a JSON document, whose meaning does not change: unprintable characters
/// are written as `\u001b`. A byte that is no UTF-8 becomes `\ufffd`.
[[nodiscard]] std::string printable_json(std::string_view json);

}  // namespace fastcycle::base

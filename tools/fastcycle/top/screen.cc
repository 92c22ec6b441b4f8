#include "top/screen.h"

#include <algorithm>
#include <cstddef>

#include <fmt/format.h>

#include "top/text.h"

namespace fastcycle::tool::top {
namespace {

/// The sequence that turns `tone` on, after a reset of all.
const char* sequence_of(Tone tone, bool has_colours) {
  switch (tone) {
    case Tone::kPlain:
      return "\x1b[0m";
    case Tone::kQuiet:
      return "\x1b[0;2m";
    case Tone::kStrong:
      return "\x1b[0;1m";
    case Tone::kGood:
      return has_colours ? "\x1b[0;32m" : "\x1b[0m";
    case Tone::kWarning:
      return has_colours ? "\x1b[0;33m" : "\x1b[0;1m";
    case Tone::kBad:
      return has_colours ? "\x1b[0;1;31m" : "\x1b[0;1m";
    case Tone::kBar:
      return has_colours ? "\x1b[0;30;46m" : "\x1b[0;7m";
    case Tone::kBarStrong:
      return has_colours ? "\x1b[0;1;30;42m" : "\x1b[0;1;4;7m";
    case Tone::kSelected:
      return has_colours ? "\x1b[0;1;37;44m" : "\x1b[0;7m";
  }
  return "\x1b[0m";
}

/// A similar ASCII text for `glyph`, of the same width.
std::string plain_of(const Screen::Cell& cell, bool is_wide) {
  const std::string& glyph = cell.glyph;
  if (glyph.empty() || static_cast<unsigned char>(glyph.front()) < 0x80) {
    return glyph.substr(0, 1);
  }
  const char* const close = glyph == "µ"   ? "u"
                            : glyph == "…" ? "~"
                            : glyph == "▼" ? "v"
                            : glyph == "▲" ? "^"
                            : glyph == "─" ? "-"
                            : glyph == "│" ? "|"
                            : glyph == "·" ? "."
                                           : "?";
  return is_wide ? std::string(close) + " " : close;
}

bool is_wide(const Screen& screen, int column, int row) {
  return column + 1 < screen.width() && screen.at(column + 1, row).glyph.empty();
}

/// Moves to `first` and writes the cells up to `last`.
void append_cells(std::string& output, const Screen& now, int row, int first, int last,
                  const Look& look) {
  output += fmt::format("\x1b[{};{}H", row + 1, first + 1);
  const char* tone = nullptr;
  for (int column = first; column < last; ++column) {
    const Screen::Cell& cell = now.at(column, row);
    if (const char* const wanted = sequence_of(cell.tone, look.has_colours);
        tone == nullptr || std::string_view(tone) != wanted) {
      tone = wanted;
      output += wanted;
    }
    output += look.is_utf8 ? cell.glyph : plain_of(cell, is_wide(now, column, row));
  }
  output += "\x1b[0m";
}

}  // namespace

Screen::Screen(int width, int height)
    : width_(std::max(width, 1)),
      height_(std::max(height, 1)),
      cells_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)) {}

const Screen::Cell& Screen::at(int column, int row) const {
  return cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                static_cast<std::size_t>(column)];
}

Screen::Cell& Screen::cell(int column, int row) {
  return cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                static_cast<std::size_t>(column)];
}

int Screen::put(int column, int row, std::string_view text, Tone tone) {
  for (const Glyph& glyph : glyphs_of(text)) {
    if (row < 0 || row >= height_ || column + glyph.width > width_) {
      return column;
    }
    for (int part = 0; column >= 0 && part < glyph.width; ++part) {
      clear(column + part, row);
      cell(column + part, row) = {part == 0 ? glyph.bytes : "", tone};
    }
    column += glyph.width;
  }
  return column;
}

void Screen::clear(int column, int row) {
  if (column > 0 && at(column, row).glyph.empty()) {
    cell(column - 1, row).glyph = " ";
  }
  if (column + 1 < width_ && at(column + 1, row).glyph.empty()) {
    cell(column + 1, row).glyph = " ";
  }
}

void Screen::put_right(int end, int row, std::string_view text, Tone tone) {
  put(end - width_of(text), row, text, tone);
}

void Screen::fill(int row, Tone tone) {
  for (int column = 0; row >= 0 && row < height_ && column < width_; ++column) {
    Tone& mine = cell(column, row).tone;
    mine = mine == Tone::kPlain ? tone : mine;
  }
}

std::string Screen::row_text(int row) const {
  std::string text;
  for (int column = 0; column < width_; ++column) {
    text += at(column, row).glyph;
  }
  text.erase(text.find_last_not_of(' ') + 1);
  return text;
}

std::string Screen::text() const {
  std::string text;
  for (int row = 0; row < height_; ++row) {
    text += row_text(row) + "\n";
  }
  return text;
}

std::string difference(const Screen& before, const Screen& now, const Look& look) {
  if (before.width() != now.width() || before.height() != now.height()) {
    return whole(now, look);
  }
  std::string output;
  for (int row = 0; row < now.height(); ++row) {
    const auto differs = [&](int column) { return before.at(column, row) != now.at(column, row); };
    int first = 0;
    int last = now.width();
    while (first < last && !differs(first)) {
      ++first;
    }
    while (last > first && !differs(last - 1)) {
      --last;
    }
    if (first == last) {
      continue;
    }
    // Wide characters are written whole, those that go as well as those that come.
    while (first > 0 && (now.at(first, row).glyph.empty() || before.at(first, row).glyph.empty())) {
      --first;
    }
    while (last < now.width() &&
           (now.at(last, row).glyph.empty() || before.at(last, row).glyph.empty())) {
      ++last;
    }
    append_cells(output, now, row, first, last, look);
  }
  return output;
}

std::string whole(const Screen& now, const Look& look) {
  std::string output = "\x1b[0m\x1b[2J";
  for (int row = 0; row < now.height(); ++row) {
    append_cells(output, now, row, 0, now.width(), look);
  }
  return output;
}

}  // namespace fastcycle::tool::top

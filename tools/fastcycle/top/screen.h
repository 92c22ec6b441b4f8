#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::tool::top {

/// The role of a piece of text; the terminal decides how it looks.
enum class Tone : std::uint8_t {
  kPlain,
  kQuiet,   ///< Less important than the rest.
  kStrong,  ///< What to look at first.
  kGood,
  kWarning,
  kBad,
  kBar,        ///< A bar of its own: column titles, the keys below.
  kBarStrong,  ///< The selected item of that bar.
  kSelected,   ///< The selected row.
};

/// The contents of a terminal of some size: a grid of cells.
///
/// @threads  Compatible.
class Screen {
 public:
  struct Cell {
    std::string glyph = " ";  ///< Empty: the second half of the wide character before it.
    Tone tone = Tone::kPlain;

    bool operator==(const Cell&) const = default;
  };

  Screen(int width, int height);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] const Cell& at(int column, int row) const;

  /// Writes `text`, clipped to the screen. Returns the column after it.
  int put(int column, int row, std::string_view text, Tone tone = Tone::kPlain);
  /// The same with its end before column `end`.
  void put_right(int end, int row, std::string_view text, Tone tone = Tone::kPlain);
  /// Sets the tone of a whole row, except for cells that already have one.
  void fill(int row, Tone tone);

  /// The text of one row, without the blanks at its end.
  [[nodiscard]] std::string row_text(int row) const;
  /// All rows, each ended by a line feed.
  [[nodiscard]] std::string text() const;

 private:
  [[nodiscard]] Cell& cell(int column, int row);
  /// Blanks the other half of a wide character that is overwritten on one side.
  void clear(int column, int row);

  int width_;
  int height_;
  std::vector<Cell> cells_;
};

/// How a terminal displays a screen.
struct Look {
  bool has_colours = true;
  bool is_utf8 = true;  ///< Else non-ASCII characters become `?`, or a similar ASCII character.
};

/// The output that updates a terminal from `before` to `now`; all of `now`, if the sizes differ.
[[nodiscard]] std::string difference(const Screen& before, const Screen& now, const Look& look);
/// The output that draws `now` on a terminal in any state.
[[nodiscard]] std::string whole(const Screen& now, const Look& look);

}  // namespace fastcycle::tool::top

#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::tool::top {

/// How a piece of text is meant; the terminal decides how it looks.
enum class Tone : std::uint8_t {
  kPlain,
  kQuiet,   ///< Less important than the rest.
  kStrong,  ///< What one looks for first.
  kGood,
  kWarning,
  kBad,
  kBar,        ///< On a bar of its own: column titles, the keys below.
  kBarStrong,  ///< What is chosen on that bar.
  kSelected,   ///< The row that was chosen.
};

/// What a terminal of some size shows: a grid of cells, nothing else.
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

  /// Writes `text`; what is outside of the screen is left out. Returns the column after it.
  int put(int column, int row, std::string_view text, Tone tone = Tone::kPlain);
  /// The same with its end before column `end`.
  void put_right(int end, int row, std::string_view text, Tone tone = Tone::kPlain);
  /// Gives a whole row `tone`; where a cell has one already, that stays.
  void fill(int row, Tone tone);

  /// The text of one row, without the blanks at its end.
  [[nodiscard]] std::string row_text(int row) const;
  /// All rows, each ended by a line feed.
  [[nodiscard]] std::string text() const;

 private:
  [[nodiscard]] Cell& cell(int column, int row);
  /// Of a wide character that is overwritten on one side the other side becomes blank.
  void clear(int column, int row);

  int width_;
  int height_;
  std::vector<Cell> cells_;
};

/// How a terminal shows what a screen says.
struct Look {
  bool has_colours = true;
  bool is_utf8 = true;  ///< Else what is not ASCII becomes `?`, or what comes close to it.
};

/// What a terminal that shows `before` must get to show `now`; all of it, if the sizes differ.
[[nodiscard]] std::string difference(const Screen& before, const Screen& now, const Look& look);
/// What a terminal must get to show `now`, whatever it shows.
[[nodiscard]] std::string whole(const Screen& now, const Look& look);

}  // namespace fastcycle::tool::top

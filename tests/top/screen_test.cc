#include "top/screen.h"

#include <cstdlib>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "top/text.h"

namespace fastcycle::tool::top {
namespace {

constexpr Look kPlainLook{.has_colours = false, .is_utf8 = true};

/// What a terminal makes of what it is sent: the few sequences that a screen uses, and no others.
class Paper {
 public:
  Paper(int width, int height)
      : width_(width), cells_(static_cast<std::size_t>(width * height), "~") {}

  void send(std::string_view bytes) {
    while (!bytes.empty()) {
      if (bytes.starts_with("\x1b[")) {
        const std::size_t end = bytes.find_first_of("HJm");
        ASSERT_NE(end, std::string_view::npos);
        obey(bytes.substr(2, end - 2), bytes[end]);
        bytes.remove_prefix(end + 1);
      } else {
        const std::size_t end = bytes.find('\x1b');
        write(bytes.substr(0, end));
        bytes.remove_prefix(std::min(end, bytes.size()));
      }
    }
  }

  [[nodiscard]] std::string text() const {
    std::string all;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      all += cells_[i];
      all += (i + 1) % static_cast<std::size_t>(width_) == 0 ? "\n" : "";
    }
    return all;
  }

 private:
  void obey(std::string_view numbers, char final) {
    if (final == 'H') {
      row_ = std::atoi(numbers.data()) - 1;
      column_ = std::atoi(numbers.data() + numbers.find(';') + 1) - 1;
    } else if (final == 'J') {
      cells_.assign(cells_.size(), " ");
    }
  }

  void write(std::string_view text) {
    for (const Glyph& glyph : glyphs_of(text)) {
      ASSERT_LE(column_ + glyph.width, width_);
      const auto place = static_cast<std::size_t>(row_ * width_ + column_);
      // As real ones: who writes on one half of a wide character destroys the other.
      if (cells_[place].empty()) {
        cells_[place - 1] = "#";
      }
      const std::size_t after = place + static_cast<std::size_t>(glyph.width);
      if (column_ + glyph.width < width_ && cells_[after].empty()) {
        cells_[after] = "#";
      }
      cells_[place] = glyph.bytes;
      if (glyph.width == 2) {
        cells_[place + 1] = "";
      }
      column_ += glyph.width;
    }
  }

  int width_;
  int row_ = 0;
  int column_ = 0;
  std::vector<std::string> cells_;
};

std::string cells_of(const Screen& screen) {
  std::string all;
  for (int row = 0; row < screen.height(); ++row) {
    for (int column = 0; column < screen.width(); ++column) {
      all += screen.at(column, row).glyph;
    }
    all += "\n";
  }
  return all;
}

TEST(AScreen, ShowsTextWhereItWasPut) {
  Screen screen(10, 2);

  EXPECT_EQ(screen.put(2, 0, "ab"), 4);
  screen.put_right(10, 1, "12");

  EXPECT_EQ(screen.text(), "  ab\n        12\n");
}

TEST(AScreen, LeavesOutWhatIsOutside) {
  Screen screen(4, 1);

  screen.put(2, 0, "abcdef");
  screen.put(0, 1, "x");
  screen.put(0, -1, "x");
  EXPECT_EQ(screen.text(), "  ab\n");

  screen.put(-1, 0, "xyz");
  EXPECT_EQ(screen.text(), "yzab\n");

  screen.put(3, 0, "激");
  EXPECT_EQ(screen.text(), "yzab\n") << "half a character has no room";
}

TEST(AScreen, ThatIsTheSameSendsNothing) {
  Screen screen(20, 3);
  screen.put(0, 1, "the same");

  EXPECT_EQ(difference(screen, screen, kPlainLook), "");
}

TEST(AScreen, SendsOnlyWhatDiffers) {
  Screen before(20, 3);
  before.put(0, 1, "rate 12.3");
  Screen now(20, 3);
  now.put(0, 1, "rate 12.4");

  EXPECT_EQ(difference(before, now, kPlainLook), "\x1b[2;9H\x1b[0m4\x1b[0m");
}

TEST(AScreen, OfAnotherSizeIsSentWhole) {
  const Screen before(20, 3);
  const Screen now(21, 3);

  EXPECT_EQ(difference(before, now, kPlainLook), whole(now, kPlainLook));
}

TEST(AScreen, ReachesTheTerminalWhateverItShowedBefore) {
  std::mt19937 random(7);
  const auto below = [&](int end) {
    return static_cast<int>(random() % static_cast<unsigned>(end));
  };
  const std::vector<std::string> words{"a", "激光", "ab c", "🚗", "e\xcc\x81", " ", "xyz激"};
  Screen before(17, 4);
  Paper paper(17, 4);
  paper.send(whole(before, kPlainLook));

  for (int i = 0; i < 2000; ++i) {
    Screen now = below(3) == 0 ? Screen(17, 4) : before;
    for (int j = below(4); j >= 0; --j) {
      now.put(below(17), below(4), words[static_cast<std::size_t>(below(7))],
              static_cast<Tone>(below(9)));
    }
    paper.send(difference(before, now, kPlainLook));
    ASSERT_EQ(paper.text(), cells_of(now)) << "after " << i << " screens";
    before = now;
  }
}

TEST(AScreen, HasNoColoursWhereNoneAreWanted) {
  Screen screen(3, 1);
  for (int tone = 0; tone <= static_cast<int>(Tone::kSelected); ++tone) {
    screen.put(0, 0, "x", static_cast<Tone>(tone));
    const std::string sent = whole(screen, {.has_colours = false, .is_utf8 = true});
    EXPECT_EQ(sent.find(";3"), std::string::npos) << sent;
    EXPECT_EQ(sent.find(";4"
                        "6"),
              std::string::npos)
        << sent;
  }
  screen.put(0, 0, "x", Tone::kBad);
  EXPECT_NE(whole(screen, {}).find("\x1b[0;1;31m"), std::string::npos);
}

TEST(AScreen, IsAsciiWhereTheTerminalKnowsNothingElse) {
  Screen screen(12, 1);
  screen.put(0, 0, "12µs…▼激x");

  const std::string sent = whole(screen, {.has_colours = false, .is_utf8 = false});

  EXPECT_NE(sent.find("12us~v? x"), std::string::npos) << sent;
}

}  // namespace
}  // namespace fastcycle::tool::top

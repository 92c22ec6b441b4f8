#include "top/text.h"

#include <string>

#include <gtest/gtest.h>

namespace fastcycle::tool::top {
namespace {

TEST(Text, IsAsWideAsATerminalShowsIt) {
  EXPECT_EQ(width_of("lidar/points"), 12);
  EXPECT_EQ(width_of("größe"), 5);
  EXPECT_EQ(width_of("gro\xcc\x88\xc3\x9f"
                     "e"),
            5)
      << "an accent of its own takes no column";
  EXPECT_EQ(width_of("激光雷达"), 8);
  EXPECT_EQ(width_of("🚗"), 2);
}

TEST(Text, HasNothingThatATerminalWouldObey) {
  std::string shown;
  for (const Glyph& glyph : glyphs_of("a\x1b[2J\x07\xff\xe2\x80\xae"
                                      "b\xc2\x9b")) {
    shown += glyph.bytes;
  }
  EXPECT_EQ(shown, "a?[2J???b?");
}

TEST(Text, OfACutCharacterIsNoCharacter) {
  EXPECT_EQ(glyphs_of("\xe6\xbf").size(), 2U);
  EXPECT_EQ(glyphs_of("\xf0\x9f\x9a").size(), 3U);
  EXPECT_EQ(glyphs_of("\xc0\x80").size(), 2U) << "an overlong form";
}

TEST(Text, ThatIsTooLongSaysSo) {
  EXPECT_EQ(shortened("localization", 12), "localization");
  EXPECT_EQ(shortened("localization", 8), "localiz…");
  EXPECT_EQ(shortened("激光雷达", 6), "激光…") << "half a wide character cannot be shown";
  EXPECT_EQ(shortened("激光雷达", 7), "激光雷…");
  EXPECT_EQ(shortened("x", 0), "");
}

TEST(AName, KeepsItsEndWhenItIsTooLong) {
  EXPECT_EQ(shortened_name("sensors/front/lidar/points", 26), "sensors/front/lidar/points");
  EXPECT_EQ(shortened_name("sensors/front/lidar/points", 16), "senso…dar/points");
  EXPECT_EQ(shortened_name("sensors/front/lidar/points", 3), "se…");
}

TEST(ANumber, HasThreeDigitsAndItsUnit) {
  EXPECT_EQ(time_text(0), "0");
  EXPECT_EQ(time_text(850), "850ns");
  EXPECT_EQ(time_text(999.6), "1.00µs");
  EXPECT_EQ(time_text(12'340), "12.3µs");
  EXPECT_EQ(time_text(999'600), "1.00ms");
  EXPECT_EQ(time_text(123e6), "123ms");
  EXPECT_EQ(time_text(1.5e9), "1.50s");
  EXPECT_EQ(time_text(600e9), "10.0m");
  EXPECT_EQ(time_text(9000e9), "2.5h");
  EXPECT_EQ(rate_text(0.01), "0.01");
  EXPECT_EQ(rate_text(99.9), "99.9");
  EXPECT_EQ(rate_text(2345), "2345");
  EXPECT_EQ(rate_text(12'345), "12.3k");
  EXPECT_EQ(size_text(999), "999B");
  EXPECT_EQ(size_text(400e6), "400MB");
  EXPECT_EQ(count_text(99'999), "99999");
  EXPECT_EQ(count_text(1'234'567), "1.23M");
  EXPECT_EQ(percent_text(7.25), "7.2");
  EXPECT_EQ(percent_text(180), "180");
  EXPECT_EQ(clock_text(83.9), "0:01:23");
  EXPECT_EQ(clock_text(180'000), "2d 2:00:00");
}

TEST(ANumber, FitsIntoSixColumns) {
  for (double number = 1e-3; number < 1e18; number *= 1.37) {
    EXPECT_LE(width_of(time_text(std::min(number, 3e15))), 6) << number;
    EXPECT_LE(width_of(rate_text(std::min(number, 1e12))), 6) << number;
    EXPECT_LE(width_of(size_text(std::min(number, 1e14))), 6) << number;
    EXPECT_LE(width_of(count_text(static_cast<std::uint64_t>(std::min(number, 1e14)))), 6)
        << number;
  }
}

}  // namespace
}  // namespace fastcycle::tool::top

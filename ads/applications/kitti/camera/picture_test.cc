#include "applications/kitti/camera/picture.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>

namespace kitti {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr Rgb kRed = {255, 0, 0};

Picture colorful() {
  Picture picture(7, 5);
  for (std::size_t index = 0; index < picture.rgb.size(); ++index) {
    picture.rgb[index] = static_cast<std::uint8_t>(index * 37);
  }
  return picture;
}

std::size_t count(const Picture& picture, const Rgb& color) {
  std::size_t found = 0;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      found += picture.at(x, y) == color ? 1 : 0;
    }
  }
  return found;
}

TEST(Picture, IsTheSameAfterAPng) {
  const Picture picture = colorful();

  const std::string png = encode_png(picture);

  EXPECT_EQ(decode_png(png, "a.png").rgb, picture.rgb);
  EXPECT_EQ(size_of_png(png, "a.png").width, 7);
  EXPECT_EQ(size_of_png(png, "a.png").height, 5);
}

TEST(Picture, OtherBytesAreNamed) {
  EXPECT_THAT(
      [] { (void)decode_png("no picture", "a.png"); },
      ThrowsMessage<std::runtime_error>(HasSubstr("a.png: expected a PNG, found 10 bytes")));
  EXPECT_THROW((void)encode_png({}), std::runtime_error);
}

TEST(Picture, DamageIsReportedOrSurvived) {
  const std::string png = encode_png(colorful());
  for (std::size_t cut = 0; cut < png.size(); ++cut) {
    try {
      (void)decode_png(png.substr(0, cut), "a.png");
    } catch (const std::runtime_error&) {  // As it should be.
    }
    std::string bad = png;
    bad[cut] = static_cast<char>(bad[cut] ^ 0x55);
    try {
      EXPECT_EQ(decode_png(bad, "a.png").width, 7);
    } catch (const std::runtime_error&) {
    }
  }
}

TEST(Picture, HugeOnesAreRefusedBeforeTheyAreUnpacked) {
  std::string png = encode_png(Picture(1, 1));
  // Width and height of the head; its checksum is not right any more, or else it is too large.
  for (const std::size_t at : {16U, 20U}) {
    png.replace(at, 4, std::string("\x00\x10\x00\x00", 4));
  }

  EXPECT_THROW((void)decode_png(png, "a.png"), std::runtime_error);
}

TEST(Picture, LinesAreDrawnAsFarAsThePictureGoes) {
  Picture picture(10, 10);

  draw_line(picture, {-1e9, 5.0}, {1e9, 5.0}, kRed);

  EXPECT_EQ(count(picture, kRed), 20U) << "two pixels wide";
  EXPECT_EQ(picture.at(0, 5), kRed);
  EXPECT_EQ(picture.at(9, 6), kRed);
}

TEST(Picture, LinesBesideItAndWithoutEndAreNotDrawn) {
  Picture picture(10, 10);
  const double infinity = std::numeric_limits<double>::infinity();

  draw_line(picture, {-5.0, 20.0}, {15.0, 12.0}, kRed);
  draw_line(picture, {0.0, 0.0}, {infinity, 5.0}, kRed);
  draw_line(picture, {std::nan(""), 0.0}, {5.0, 5.0}, kRed);
  Picture nothing;
  draw_line(nothing, {0.0, 0.0}, {5.0, 5.0}, kRed);

  EXPECT_EQ(count(picture, kRed), 0U);
}

}  // namespace
}  // namespace kitti

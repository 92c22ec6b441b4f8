#include "drive_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rav4 {
namespace {

using testing::HasSubstr;
using testing::Not;

DrivePicture northward() {
  DrivePicture picture;
  picture.title = "A & B <drive>";
  picture.subtitle = "700 m";
  for (int step = 0; step <= 70; ++step) {
    const PlanePoint reference{.east_m = 0.1 * step, .north_m = 10.0 * step};
    const PlanePoint off{.east_m = reference.east_m - 0.4, .north_m = reference.north_m - 1.5};
    picture.reference.push_back(reference);
    picture.estimate.push_back({reference.east_m - 0.4, reference.north_m});
    picture.fixes.push_back(
        {.time_s = 0.6 * step, .position = off, .reference = reference, .error_m = 1.55});
    picture.estimates.push_back({.time_s = 0.6 * step,
                                 .position = picture.estimate.back(),
                                 .reference = reference,
                                 .error_m = 0.4});
  }
  picture.judgements = {{.from_s = 0.0, .to_s = 1.0, .judgement = "starting"},
                        {.from_s = 1.0, .to_s = 42.0, .judgement = "ready"}};
  return picture;
}

TEST(DrivePicture, PictureShowsPathsScaleBarAndMeans) {
  const std::string svg = draw_svg(northward());

  EXPECT_THAT(svg, HasSubstr("A &amp; B &lt;drive&gt;"));
  EXPECT_THAT(svg, HasSubstr("Raw GNSS fix"));
  EXPECT_THAT(svg, HasSubstr(">100 m<"));
  EXPECT_THAT(svg, HasSubstr("raw fix: 1.55 m"));
  EXPECT_THAT(svg, HasSubstr("estimate: 0.40 m"));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(DrivePicture, EqualDrivesGiveEqualBytes) {
  EXPECT_EQ(draw_svg(northward()), draw_svg(northward()));
}

TEST(DrivePicture, EmptyDriveIsAPictureToo) {
  const std::string svg = draw_svg(DrivePicture{});

  EXPECT_THAT(svg, HasSubstr("</svg>"));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST(DrivePicture, CarThatStandsIsAPictureToo) {
  DrivePicture picture;
  picture.reference.assign(50, PlanePoint{.east_m = 1.0, .north_m = 2.0});
  picture.estimates.push_back({.time_s = 0.0, .position = {}, .reference = {}, .error_m = 0.0});
  const std::string svg = draw_svg(picture);

  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf,")));
}

}  // namespace
}  // namespace rav4

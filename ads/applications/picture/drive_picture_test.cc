#include "drive_picture.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace ads {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

DrivePicture short_drive() {
  DrivePicture picture;
  picture.title = "A <drive>";
  picture.lanes = {{.left = {{0.0, 2.0}, {100.0, 2.0}}, .right = {{0.0, -2.0}, {100.0, -2.0}}}};
  picture.goals = {{.center_m = {90.0, 0.0}, .heading_rad = 0.0, .length_m = 2.0, .width_m = 1.6}};
  for (int i = 0; i < 50; ++i) {
    const double x = 1.5 * i;
    picture.moments.push_back(
        {.time_s = 0.1 * i,
         .ego = {.center_m = {x, 0.0}, .heading_rad = 0.0, .length_m = 4.5, .width_m = 1.6},
         .speed_mps = 15.0,
         .acceleration_mps2 = 0.0,
         .gap_m = std::numeric_limits<double>::infinity(),
         .state = "engaged",
         .objects = {{.id = 7,
                      .box = {.center_m = {x + 20.0, 0.0},
                              .heading_rad = 0.0,
                              .length_m = 4.0,
                              .width_m = 1.8}}},
         .plan = {{x, 0.0}, {x + 30.0, 0.0}}});
  }
  picture.events = {{.time_s = 1.0, .text = "engaged"}};
  return picture;
}

TEST(DrivePicture, ShowsTheDriveItsMomentsAndEvents) {
  const std::string svg = draw_svg(short_drive());

  EXPECT_THAT(svg, HasSubstr("A &lt;drive&gt;"));
  EXPECT_THAT(svg, HasSubstr("speed, m/s"));
  EXPECT_THAT(svg, HasSubstr("engaged"));
  EXPECT_THAT(svg, HasSubstr("</svg>"));
}

TEST(DrivePicture, IsTheSameForTheSameDrive) {
  EXPECT_EQ(draw_svg(short_drive()), draw_svg(short_drive()));
}

TEST(DrivePicture, HasNoNumberThatIsNone) {
  for (const bool has_moments : {false, true}) {
    DrivePicture picture = short_drive();
    if (!has_moments) {
      picture.moments.clear();
    } else {
      picture.moments.resize(1);
    }

    const std::string svg = draw_svg(picture);

    EXPECT_THAT(svg, Not(HasSubstr("nan")));
    EXPECT_THAT(svg, Not(HasSubstr("inf")));
  }
}

}  // namespace
}  // namespace ads

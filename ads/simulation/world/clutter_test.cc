#include "clutter.h"

#include <gtest/gtest.h>

#include "small_scenario.h"

namespace ads {
namespace {

Scenario road() {
  return Scenario::parse(testing::SmallScenario().standing(7, 100.0, -4.0).goal(50.0, 40, 50).xml(),
                         "small");
}

TEST(Clutter, IsNoneWithoutAShare) {
  EXPECT_TRUE(draw_clutter(road(), 0.0, 1).empty());
}

TEST(Clutter, StandsBesideTheRoadAndFreeOfWhatElseIsThere) {
  const Scenario scenario = road();
  const Box parked{.center_m = {100.0, -4.0}, .length_m = 4.0, .width_m = 2.0};
  std::size_t count = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    for (const Body& body : draw_clutter(scenario, 1.0, seed)) {
      ++count;
      EXPECT_LT(body.id, 0);
      EXPECT_GT(body.height_m, 0.5);
      EXPECT_GE(distance_m(body.box, parked), kClutterSpace_m);
      for (const Eigen::Vector2d& corner : body.box.corners()) {
        // Two lanes of 3.5 m, the right one around y = 0.
        EXPECT_TRUE(corner.y() < -1.75 - kClutterSpace_m + 1e-9 ||
                    corner.y() > 5.25 + kClutterSpace_m - 1e-9)
            << corner.y();
      }
    }
  }
  // Some for each edge of some hundred metres, one at about each 12 m.
  EXPECT_GT(count, 50U * 30U);
  EXPECT_LT(count, 50U * 100U);
}

TEST(Clutter, OfOneSeedIsTheSame) {
  const std::vector<Body> one = draw_clutter(road(), 1.0, 3);
  const std::vector<Body> other = draw_clutter(road(), 1.0, 3);

  ASSERT_EQ(one.size(), other.size());
  EXPECT_EQ(one.back().box.center_m, other.back().box.center_m);
  EXPECT_NE(one.front().box.center_m, draw_clutter(road(), 1.0, 4).front().box.center_m);
}

}  // namespace
}  // namespace ads

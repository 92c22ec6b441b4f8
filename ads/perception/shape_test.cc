#include "shape.h"

#include <vector>

#include <gtest/gtest.h>

namespace ads {
namespace {

// Points of an upright face ahead of the sensor at the origin, `width_m` across the line of sight.
Shape face(double width_m, double bottom_m, double top_m, double depth_m = 0.0) {
  std::vector<ObjectPoint> points;
  for (int step = 0; step <= 20; ++step) {
    const double share = step / 20.0;
    for (int level = 0; level <= 10; ++level) {
      points.push_back(
          {.place_m = {15.0 + depth_m * share, width_m * (share - 0.5)},
           .height_m = static_cast<float>(bottom_m + (top_m - bottom_m) * level / 10.0)});
    }
  }
  return shape_of({.points = points}, 0.0);
}

TEST(Shape, IsMeasuredAlongItsBoxAndAcrossTheLineOfSight) {
  const Shape shape = face(1.8, 0.25, 1.5, 3.0);
  EXPECT_NEAR(shape.along_m, 3.0, 1e-6);
  EXPECT_NEAR(shape.across_m, 1.8, 1e-6);
  EXPECT_NEAR(shape.width_m, 1.8, 0.3);
  EXPECT_NEAR(shape.bottom_m, 0.25, 1e-6);
  EXPECT_NEAR(shape.top_m, 1.5, 1e-6);
  EXPECT_EQ(shape.high_share, 0.0);
}

TEST(Shape, RearOfACarLooksLikeAVehicle) {
  EXPECT_EQ(likeness_of(face(1.7, 0.25, 1.5)), Likeness::kVehicle);
  EXPECT_EQ(likeness_of(face(1.8, 0.25, 2.0, 4.5)), Likeness::kVehicle) << "a van";
}

TEST(Shape, NarrowThingsAsHighAsAPersonLookLikeTwoWheelers) {
  EXPECT_EQ(likeness_of(face(0.6, 0.25, 1.7, 1.5)), Likeness::kTwoWheeler);
}

TEST(Shape, PostsWallsKerbsAndLeavesLookLikeNeither) {
  EXPECT_EQ(likeness_of(face(0.15, 0.2, 1.7)), Likeness::kNeither) << "a post";
  EXPECT_EQ(likeness_of(face(12.0, 0.2, 3.0)), Likeness::kNeither) << "a wall";
  EXPECT_EQ(likeness_of(face(3.0, 0.2, 0.7)), Likeness::kNeither) << "a kerb";
  EXPECT_EQ(likeness_of(face(2.0, 1.2, 2.0)), Likeness::kNeither) << "leaves";
  EXPECT_EQ(likeness_of({}), Likeness::kNeither);
}

TEST(Shape, PartOfACarIsUnclear) {
  EXPECT_EQ(likeness_of(face(0.9, 0.7, 1.2)), Likeness::kNeither) << "nothing below";
  EXPECT_EQ(likeness_of(face(0.9, 0.3, 1.2)), Likeness::kUnclear);
}

}  // namespace
}  // namespace ads

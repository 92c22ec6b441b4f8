#include "shape.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr double kSensor_m = 1.7;

// Points of an upright face ahead of the sensor at the origin, `width_m` across the line of sight.
std::vector<ObjectPoint> points_of(double width_m, double bottom_m, double top_m, double depth_m) {
  std::vector<ObjectPoint> points;
  for (int step = 0; step <= 20; ++step) {
    const double share = step / 20.0;
    const Eigen::Vector2d place_m(15.0 + depth_m * share, width_m * (share - 0.5));
    for (int level = 0; level <= 10; ++level) {
      points.push_back(
          {.place_m = place_m,
           .height_m = static_cast<float>(bottom_m + (top_m - bottom_m) * level / 10.0),
           .azimuth_rad = static_cast<float>(std::atan2(place_m.y(), place_m.x())),
           .range_m = static_cast<float>(place_m.norm())});
    }
  }
  return points;
}

Shape face(double width_m, double bottom_m, double top_m, double depth_m = 0.0,
           const std::vector<LidarReturn>& others = {}) {
  const auto points = points_of(width_m, bottom_m, top_m, depth_m);
  Skyline skyline;
  skyline.fill(others, kSensor_m);
  HighPlaces high_places;
  high_places.fill(others, Eigen::Vector2d::Zero());
  return shape_of({.points = points}, skyline, high_places, 0.0);
}

LidarReturn return_at(double x_m, double y_m, double height_m) {
  return {.place_m = {static_cast<float>(x_m), static_cast<float>(y_m)},
          .height_m = static_cast<float>(height_m),
          .azimuth_rad = static_cast<float>(std::atan2(y_m, x_m)),
          .range_m = static_cast<float>(std::hypot(x_m, y_m))};
}

// Across the way at `x_m`, so high.
std::vector<LidarReturn> row(double x_m, double height_m, double from_m, double to_m) {
  std::vector<LidarReturn> returns;
  for (double y_m = from_m; y_m < to_m; y_m += 0.02) {
    returns.push_back(return_at(x_m, y_m, height_m));
  }
  return returns;
}

TEST(Shape, IsMeasuredAlongItsBoxAndAcrossTheLineOfSight) {
  const Shape shape = face(1.8, 0.25, 1.5, 3.0);
  EXPECT_NEAR(shape.along_m, 3.0, 1e-6);
  EXPECT_NEAR(shape.across_m, 1.8, 1e-6);
  EXPECT_NEAR(shape.width_m, 1.8, 0.3);
  EXPECT_NEAR(shape.gap_m, 0.25, 1e-6);
  EXPECT_NEAR(shape.top_m, 1.5, 1e-6);
  EXPECT_FALSE(shape.is_cut);
  EXPECT_EQ(shape.high_share, 0.0);
}

TEST(Shape, GapEndsAtWhatStandsBefore) {
  // Seen from 1.7 m over 1.0 m at 10 m, things at 15 m are hidden up to 0.65 m.
  EXPECT_NEAR(face(1.8, 0.7, 1.5, 0.0, row(10.0, 1.0, -2.0, 2.0)).gap_m, 0.05, 0.01);
  EXPECT_NEAR(face(1.8, 0.7, 1.5, 0.0, row(14.0, 1.0, -2.0, 2.0)).gap_m, 0.7, 1e-6)
      << "what is so close may be a part of it";
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

TEST(Shape, PartOfACarIsAPart) {
  EXPECT_EQ(likeness_of(face(0.9, 0.3, 1.2)), Likeness::kUnclear);
  EXPECT_EQ(likeness_of(face(1.1, 0.3, 1.2)), Likeness::kVehiclePart);
}

TEST(Shape, NothingIsMissedWhereSomethingStandsBefore) {
  EXPECT_EQ(likeness_of(face(1.7, 0.8, 1.5)), Likeness::kNeither) << "nothing below";
  EXPECT_EQ(likeness_of(face(1.7, 0.8, 1.5, 0.0, row(10.0, 1.0, -2.0, 2.0))), Likeness::kVehicle);
  EXPECT_EQ(likeness_of(face(0.2, 0.3, 1.5)), Likeness::kNeither) << "a post";
  EXPECT_EQ(likeness_of(face(0.2, 0.3, 1.5, 0.0, row(10.0, 1.0, 0.05, 2.0))), Likeness::kUnclear);
  EXPECT_EQ(likeness_of(face(0.6, 0.25, 1.7, 1.5, row(10.0, 1.0, 0.2, 2.0))), Likeness::kUnclear)
      << "a car, or somebody on two wheels";
}

TEST(Shape, ThatMayBeHigherThanSeenIsOnlyAPart) {
  Shape shape = face(1.9, 0.25, 2.0);
  EXPECT_EQ(likeness_of(shape), Likeness::kVehicle) << "a van";
  shape.is_top_open = true;
  EXPECT_EQ(likeness_of(shape), Likeness::kVehiclePart) << "a van, or a wall that goes on upwards";
}

TEST(Shape, TopIsOpenWhereNoBeamLooksHigher) {
  const auto top_of = [](float height_m) {
    std::vector<ObjectPoint> points = points_of(1.9, 0.25, 1.6, 0.0);
    for (int step = 0; step < 5; ++step) {
      points.push_back({.place_m = {15.0, 0.1 * step},
                        .height_m = height_m,
                        .range_m = 15.0F,
                        .is_of_top = true});
    }
    return shape_of({.points = points}, Skyline(), HighPlaces(), 0.0).is_top_open;
  };
  EXPECT_TRUE(top_of(2.0F));
  EXPECT_FALSE(top_of(1.5F)) << "the beams do not look high, but a car ends there";
}

TEST(Shape, FlatThingInTheLineOfAWallIsAPartOfIt) {
  EXPECT_EQ(likeness_of(face(3.0, 0.2, 1.6, 0.0, row(15.0, 2.5, 2.0, 6.0))), Likeness::kNeither);
  EXPECT_EQ(likeness_of(face(3.0, 0.2, 1.6, 0.0, row(17.0, 2.5, 2.0, 6.0))), Likeness::kVehicle)
      << "beside a wall";
}

}  // namespace
}  // namespace ads

#include "common/plane.h"

#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace ads {
namespace {

using Points = std::vector<Eigen::Vector2d>;
constexpr double kPi = std::numbers::pi;

Box box(double x_m, double y_m, double heading_rad, double length_m, double width_m) {
  return {
      .center_m = {x_m, y_m}, .heading_rad = heading_rad, .length_m = length_m, .width_m = width_m};
}

// A quarter of a circle to the left, from the origin along +x.
Polyline quarter(double radius_m, int points) {
  Points line;
  for (int index = 0; index < points; ++index) {
    const double angle = kPi / 2.0 * index / (points - 1);
    line.emplace_back(radius_m * std::sin(angle), radius_m * (1.0 - std::cos(angle)));
  }
  return Polyline(line);
}

TEST(Plane, AnglesAreBroughtIntoOneTurn) {
  EXPECT_EQ(normalize_angle(0.5), 0.5);
  EXPECT_EQ(normalize_angle(kPi), kPi);
  EXPECT_EQ(normalize_angle(-kPi), kPi);
  EXPECT_NEAR(normalize_angle(7.0 * kPi + 0.1), -kPi + 0.1, 1e-12);
  EXPECT_NEAR(normalize_angle(-100.0 * kPi - 0.1), -0.1, 1e-12);
}

TEST(Plane, BoxesBesideEachOtherAreAsFarApartAsTheirSides) {
  const Box car = box(0.0, 0.0, 0.0, 4.0, 2.0);

  EXPECT_NEAR(distance_m(car, box(0.0, 3.0, 0.0, 4.0, 2.0)), 1.0, 1e-12);
  EXPECT_NEAR(distance_m(car, box(-5.5, 0.5, kPi, 4.0, 2.0)), 1.5, 1e-12);
  EXPECT_NEAR(distance_m(car, box(7.0, 6.0, 0.0, 4.0, 2.0)), 5.0, 1e-12);
}

TEST(Plane, CornerThatPointsAtASideIsTheNearest) {
  const Box turned = box(2.0 + std::sqrt(2.0) + 0.25, 0.3, kPi / 4.0, 2.0, 2.0);

  EXPECT_NEAR(distance_m(box(0.0, 0.0, 0.0, 4.0, 2.0), turned), 0.25, 1e-12);
}

TEST(Plane, BoxesThatTouchOrCrossOverlap) {
  const Box car = box(0.0, 0.0, 0.0, 4.0, 2.0);

  EXPECT_TRUE(overlap(car, box(4.0, 0.0, 0.0, 4.0, 2.0)));
  EXPECT_FALSE(overlap(car, box(4.001, 0.0, 0.0, 4.0, 2.0)));
  // A cross: no corner of the one lies in the other.
  EXPECT_TRUE(overlap(box(0.0, 0.0, 0.0, 10.0, 1.0), box(0.0, 0.0, kPi / 2.0, 10.0, 1.0)));
  EXPECT_TRUE(overlap(car, box(0.1, 0.1, 0.3, 0.5, 0.5)));
  EXPECT_EQ(distance_m(car, box(0.1, 0.1, 0.3, 0.5, 0.5)), 0.0);
}

TEST(Plane, DistanceOfBoxesIsThatOfTheirClosestPoints) {
  std::mt19937 random;  // NOLINT(bugprone-random-generator-seed): the same boxes in each run
  std::uniform_real_distribution<double> place(-4.0, 4.0);
  std::uniform_real_distribution<double> size(0.5, 5.0);
  for (int pair = 0; pair < 50; ++pair) {
    const Box a = box(place(random), place(random), place(random), size(random), size(random));
    const Box b = box(place(random), place(random), place(random), size(random), size(random));
    double least_m = 1e9;
    for (int along = 0; along <= 40; ++along) {
      for (int across = 0; across <= 40; ++across) {
        const Eigen::Vector2d forward = direction(a.heading_rad);
        const Eigen::Vector2d point = a.center_m + forward * a.length_m * (along / 40.0 - 0.5) +
                                      left_of(forward) * a.width_m * (across / 40.0 - 0.5);
        const auto corners = b.corners();
        double away_m = b.contains(point) ? 0.0 : 1e9;
        for (std::size_t edge = 0; edge < 4 && away_m > 0.0; ++edge) {
          away_m = std::min(away_m, distance_m(point, corners[edge], corners[(edge + 1) % 4]));
        }
        least_m = std::min(least_m, away_m);
      }
    }
    EXPECT_LE(distance_m(a, b), least_m + 1e-9);
    EXPECT_NEAR(distance_m(a, b), least_m, 0.1);
    EXPECT_NEAR(distance_m(a, b), distance_m(b, a), 1e-12);
    EXPECT_EQ(overlap(a, b), distance_m(a, b) == 0.0);
  }
}

TEST(Plane, DistanceDoesNotChangeFarFromTheOrigin) {
  const Eigen::Vector2d far(4e5, -4e5);
  Box a = box(0.0, 0.0, 0.3, 4.5, 1.6);
  Box b = box(3.0, 4.0, -0.4, 4.5, 1.6);
  const double near_m = distance_m(a, b);
  a.center_m += far;
  b.center_m += far;

  EXPECT_NEAR(distance_m(a, b), near_m, 1e-9);
}

TEST(Plane, PolygonContainsItsInsideAndItsEdge) {
  const Points polygon{{0.0, 0.0}, {4.0, 0.0}, {4.0, 3.0}, {2.0, 1.0}, {0.0, 3.0}};

  EXPECT_TRUE(contains(polygon, {1.0, 1.0}));
  EXPECT_TRUE(contains(polygon, {3.5, 2.0}));
  EXPECT_FALSE(contains(polygon, {2.0, 2.0}));
  EXPECT_FALSE(contains(polygon, {5.0, 0.0}));
  EXPECT_FALSE(contains(polygon, {-1.0, 0.0}));
  EXPECT_TRUE(contains(polygon, {2.0, 0.0}));
  EXPECT_TRUE(contains(polygon, {4.0, 3.0}));
  EXPECT_FALSE(contains({}, {0.0, 0.0}));
}

TEST(Polyline, PointsAreGivenByTheirArclengthAndOffset) {
  const Polyline line(Points{{0.0, 0.0}, {10.0, 0.0}, {10.0, 0.0}, {10.0, 10.0}});

  EXPECT_EQ(line.points_m().size(), 3U);
  EXPECT_EQ(line.length_m(), 20.0);
  const auto left = line.project({4.0, 3.0});
  EXPECT_DOUBLE_EQ(left.along_m, 4.0);
  EXPECT_DOUBLE_EQ(left.offset_m, 3.0);
  const auto right = line.project({12.0, 6.0});
  EXPECT_DOUBLE_EQ(right.along_m, 16.0);
  EXPECT_DOUBLE_EQ(right.offset_m, -2.0);
  const auto corner = line.project({13.0, -4.0});
  EXPECT_DOUBLE_EQ(corner.along_m, 10.0);
  EXPECT_DOUBLE_EQ(corner.offset_m, -5.0);
  EXPECT_TRUE(line.point_at(16.0).isApprox(Eigen::Vector2d(10.0, 6.0)));
}

TEST(Polyline, BeyondItsEndsItGoesOnStraight) {
  const Polyline line(Points{{0.0, 0.0}, {10.0, 0.0}, {10.0, 10.0}});

  const auto before = line.project({-3.0, 1.0});
  EXPECT_DOUBLE_EQ(before.along_m, -3.0);
  EXPECT_DOUBLE_EQ(before.offset_m, 1.0);
  const auto after = line.project({11.0, 15.0});
  EXPECT_DOUBLE_EQ(after.along_m, 25.0);
  EXPECT_DOUBLE_EQ(after.offset_m, -1.0);
  EXPECT_TRUE(line.point_at(-3.0).isApprox(Eigen::Vector2d(-3.0, 0.0)));
  EXPECT_TRUE(line.point_at(25.0).isApprox(Eigen::Vector2d(10.0, 15.0)));
  EXPECT_EQ(line.curvature_at(25.0), 0.0);
}

TEST(Polyline, CircleHasTheHeadingAndTheCurvatureOfACircle) {
  const Polyline line = quarter(50.0, 80);

  for (double along_m = 0.0; along_m <= line.length_m(); along_m += 0.7) {
    EXPECT_NEAR(line.heading_at(along_m), along_m / 50.0, 1e-3);
    EXPECT_NEAR(line.curvature_at(along_m), 0.02, 1e-5);
    const auto place = line.project(line.point_at(along_m, 2.0));
    EXPECT_NEAR(place.along_m, along_m, 0.05);
    EXPECT_NEAR(place.offset_m, 2.0, 0.01);
  }
}

TEST(Polyline, HeadingHasNoJumpWhereAnglesHaveOne) {
  const Polyline line(Points{{0.0, 0.0}, {-10.0, 0.1}, {-20.0, 0.0}, {-30.0, -0.3}});

  for (double along_m = 0.0; along_m < line.length_m(); along_m += 0.5) {
    EXPECT_LT(std::abs(normalize_angle(line.heading_at(along_m) - kPi)), 0.06);
    EXPECT_LT(std::abs(line.curvature_at(along_m)), 0.01);
  }
}

TEST(Polyline, ResampledLineKeepsItsEndsAndItsLength) {
  const Polyline line = quarter(50.0, 400).resampled(1.0);

  EXPECT_EQ(line.points_m().size(), 80U);
  EXPECT_TRUE(line.points_m().front().isZero());
  EXPECT_TRUE(line.points_m().back().isApprox(Eigen::Vector2d(50.0, 50.0)));
  EXPECT_NEAR(line.length_m(), 25.0 * kPi, 0.01);
}

TEST(Polyline, LineNeedsTwoDifferentPoints) {
  EXPECT_THROW(Polyline(Points{}), std::invalid_argument);
  EXPECT_THROW(Polyline(Points{{1.0, 1.0}, {1.0, 1.0}}), std::invalid_argument);
}

}  // namespace
}  // namespace ads

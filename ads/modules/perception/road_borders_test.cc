#include "road_borders.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr double kSensor_m = 1.73;

// A straight road with kerbs, so far away to the left and to the right and so high.
struct Road {
  double left_m = 4.0;
  double right_m = 3.2;
  double kerb_m = 0.12;
  double crossfall = 0.0;
};

// Where one beam meets the road, the face of a kerb, or the pavement behind it.
RawReturn return_of(const Road& road, double azimuth, double elevation) {
  const double ahead = std::cos(elevation) * std::cos(azimuth);
  const double left = std::cos(elevation) * std::sin(azimuth);
  const double down = -std::sin(elevation) + road.crossfall * left;
  const double side_m = left > 0.0 ? road.left_m : road.right_m;
  const double until_face = side_m / std::max(1e-9, std::abs(left));
  const double face_m = kSensor_m - down * until_face;
  double range = kSensor_m / down;
  if (face_m > 0.0) {
    range = face_m < road.kerb_m ? until_face : (kSensor_m - road.kerb_m) / down;
  }
  const double x = range * ahead;
  const double y = range * left;
  return {.x_m = static_cast<float>(x),
          .y_m = static_cast<float>(y),
          .z_m = static_cast<float>(range * std::sin(elevation)),
          .range_m = static_cast<float>(std::hypot(x, y))};
}

std::vector<RawReturn> sweep_of(const Road& road) {
  std::vector<RawReturn> returns;
  for (double elevation = -24.0; elevation < -2.0; elevation += 0.4) {
    for (double azimuth = -180.0; azimuth < 180.0; azimuth += 0.2) {
      returns.push_back(return_of(road, azimuth * std::numbers::pi / 180.0,
                                  elevation * std::numbers::pi / 180.0));
    }
  }
  return returns;
}

void expect_at(const std::vector<BorderPlace>& border, double y_m) {
  ASSERT_GE(border.size(), 20U);
  EXPECT_LT(border.front().place_m.x(), -5.0);
  EXPECT_GT(border.back().place_m.x(), 12.0);
  double mean_m = 0.0;
  for (const BorderPlace& place : border) {
    EXPECT_NEAR(place.place_m.y(), y_m, 0.55) << "at " << place.place_m.x();
    EXPECT_LT(place.stddev_m, 0.4);
    mean_m += place.place_m.y() / static_cast<double>(border.size());
  }
  EXPECT_NEAR(mean_m, y_m, 0.15);
}

TEST(RoadBorders, AreWhereTheKerbsAre) {
  BorderFinder finder;
  const RoadBorders& borders = finder.find(sweep_of({}), kSensor_m, {});
  expect_at(borders.left, 4.0);
  expect_at(borders.right, -3.2);
}

TEST(RoadBorders, RoadThatSlopesToItsSideIsARoad) {
  BorderFinder finder;
  const RoadBorders& borders = finder.find(sweep_of({.crossfall = 0.025}), kSensor_m, {});
  expect_at(borders.left, 4.0);
  expect_at(borders.right, -3.2);
}

TEST(RoadBorders, OpenPlaneHasNone) {
  BorderFinder finder;
  const RoadBorders& borders =
      finder.find(sweep_of({.left_m = 200.0, .right_m = 200.0}), kSensor_m, {});
  EXPECT_TRUE(borders.left.empty());
  EXPECT_TRUE(borders.right.empty());
}

TEST(RoadBorders, VehicleThatStandsOnTheRoadIsNone) {
  auto returns = sweep_of({});
  for (double x = 5.0; x < 9.0; x += 0.1) {
    for (double z = 0.2; z < 1.0; z += 0.1) {
      returns.push_back({.x_m = static_cast<float>(x),
                         .y_m = 2.0F,
                         .z_m = static_cast<float>(z - kSensor_m),
                         .range_m = static_cast<float>(std::hypot(x, 2.0))});
    }
  }
  BorderFinder finder;
  const std::vector<Standing> standing{{.center_m = {7.0, 2.9}, .length_m = 4.2, .width_m = 1.8}};
  expect_at(finder.find(returns, kSensor_m, standing).left, 4.0);
  EXPECT_TRUE(finder.find({}, kSensor_m, standing).left.empty());
}

}  // namespace
}  // namespace ads

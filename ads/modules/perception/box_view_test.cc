#include "box_view.h"

#include <cmath>

#include <gtest/gtest.h>

#include "common/plane.h"

namespace ads {
namespace {

constexpr double kSpread_rad = 0.0035;

// A box around a point ahead of the sensor, which stands at the origin: what beams see of its
// walls.
class BoxViewTest : public ::testing::Test {
 protected:
  void look_at(const Box& box) {
    box_ = box;
    for (double azimuth = -3.1; azimuth < 3.1; azimuth += kSpread_rad) {
      const Eigen::Vector2d ray = direction(azimuth);
      double range = 0.0;
      while (range < 60.0 && !box.contains(range * ray)) {
        range += 0.005;
      }
      if (range < 60.0) {
        for (const float height : {0.3F, 0.6F, 0.9F, 1.2F}) {
          add(range * ray, azimuth, range, height);
        }
      }
    }
  }

  void add(const Eigen::Vector2d& place_m, double azimuth, double range, float height) {
    points_.push_back({.place_m = place_m,
                       .height_m = height,
                       .azimuth_rad = static_cast<float>(azimuth),
                       .range_m = static_cast<float>(range)});
  }

  // Something nearer between these azimuths, and the points behind it are gone.
  void hide(double from, double to) {
    std::erase_if(points_, [&](const ObjectPoint& point) {
      return point.azimuth_rad > from && point.azimuth_rad < to;
    });
    for (double azimuth = from; azimuth < to; azimuth += kSpread_rad) {
      obstacles_.push_back({.azimuth_rad = static_cast<float>(azimuth), .range_m = 3.0F});
    }
  }

  [[nodiscard]] ObjectView view() const { return {.points = points_, .spread_rad = kSpread_rad}; }

  BoxView edges(double heading_rad, double width_m = kUsualWidth_m) {
    auto returns = obstacles_;
    for (const ObjectPoint& point : points_) {
      returns.push_back({.azimuth_rad = point.azimuth_rad, .range_m = point.range_m});
    }
    skyline_.fill(returns, 1.7);
    return view_box(view(), skyline_, box_.center_m, heading_rad, width_m);
  }

  Box box_;
  std::vector<ObjectPoint> points_;
  std::vector<LidarReturn> obstacles_;
  Skyline skyline_;
};

TEST_F(BoxViewTest, CornerShowsAllFourEdges) {
  look_at({.center_m = {12.0, 5.0}, .heading_rad = 0.0, .length_m = 4.6, .width_m = 1.8});
  const BoxView box = edges(0.0);

  EXPECT_TRUE(box.front.is_end && box.rear.is_end && box.left.is_end && box.right.is_end);
  EXPECT_NEAR(box.rear.place_m, -2.3, 0.05);
  EXPECT_NEAR(box.right.place_m, -0.9, 0.05);
  EXPECT_NEAR(box.front.place_m, 2.3, 3.0 * box.front.stddev_m);
  EXPECT_NEAR(box.left.place_m, 0.9, 3.0 * box.left.stddev_m);
  EXPECT_NEAR(box.height_m, 1.2, 1e-6);
}

TEST_F(BoxViewTest, RearAloneSaysNothingOfTheFront) {
  look_at({.center_m = {20.0, 0.0}, .heading_rad = 0.0, .length_m = 4.6, .width_m = 1.8});
  const BoxView box = edges(0.0);

  EXPECT_TRUE(box.rear.is_end && box.left.is_end && box.right.is_end);
  EXPECT_FALSE(box.front.is_end);
  EXPECT_NEAR(box.rear.place_m, -2.3, 0.03);
  EXPECT_NEAR(box.left.place_m, 0.9, 0.1);
}

// A bicycle far away, whose heading is not well known.
TEST_F(BoxViewTest, ANarrowObjectEndsWhereLittleOfAFaceIsSeen) {
  look_at({.center_m = {35.0, 0.0}, .heading_rad = 0.0, .length_m = 1.8, .width_m = 0.6});

  EXPECT_FALSE(edges(0.3).rear.is_end);
  const BoxView box = edges(0.3, 0.6);
  EXPECT_TRUE(box.rear.is_end);
  EXPECT_NEAR(box.rear.place_m, -0.9, 0.15);
}

TEST_F(BoxViewTest, EndThatIsHiddenIsOnlyABound) {
  look_at({.center_m = {12.0, 5.0}, .heading_rad = 0.0, .length_m = 4.6, .width_m = 1.8});
  hide(0.2, 0.34);
  const BoxView box = edges(0.0);

  EXPECT_FALSE(box.front.is_end);
  EXPECT_LT(box.front.place_m, 2.3);
  EXPECT_TRUE(box.rear.is_end);
}

TEST_F(BoxViewTest, ReturnsOfARoofAreNoEdge) {
  look_at({.center_m = {20.0, 0.0}, .heading_rad = 0.0, .length_m = 4.6, .width_m = 1.8});
  for (double y = -0.8; y < 0.85; y += 0.07) {
    add({19.0, y}, std::atan2(y, 19.0), 19.0, 1.2F);
  }
  const BoxView box = edges(0.0);

  EXPECT_FALSE(box.front.is_end);
  EXPECT_NEAR(box.front.place_m, -1.0, 0.01);
}

TEST_F(BoxViewTest, HeadingIsThatOfTheFaces) {
  look_at({.center_m = {12.0, 5.0}, .heading_rad = 0.1, .length_m = 4.6, .width_m = 1.8});
  const auto heading = heading_of_faces(view(), {12.0, 5.0}, 0.06);

  ASSERT_TRUE(heading);
  EXPECT_NEAR(heading->heading_rad, 0.1, 0.01);
  EXPECT_LT(heading->stddev_rad, 0.02);
}

// Seen over another car, whose outline cuts the roof off at an angle.
TEST_F(BoxViewTest, RoofAloneHasNoHeading) {
  for (double x = -2.0; x < 2.0; x += 0.1) {
    add({12.0 + x, 5.6 + 0.15 * x}, 0.0, 13.0, 1.5F);
    add({12.0 + x, 5.5 + 0.15 * x}, 0.0, 13.0, 1.4F);
  }

  EXPECT_FALSE(heading_of_faces(view(), {12.0, 5.0}, 0.0));
}

TEST_F(BoxViewTest, HeadingIsFoundWithoutAnyKnowledge) {
  look_at({.center_m = {12.0, 5.0}, .heading_rad = 0.5, .length_m = 4.6, .width_m = 1.8});

  EXPECT_NEAR(heading_by_closeness(view(), 0.0, 0.79), 0.5, 0.03);
}

TEST_F(BoxViewTest, FewPointsHaveNoHeading) {
  add({10.0, 0.0}, 0.0, 10.0, 1.0F);
  add({10.0, 0.1}, 0.01, 10.0, 1.0F);

  EXPECT_FALSE(heading_of_faces(view(), {10.0, 0.0}, 0.0));
}

}  // namespace
}  // namespace ads

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "fastcycle/transforms_eigen.h"

namespace fastcycle::transforms {
namespace {

constexpr double kQuarter = std::numbers::pi / 2;

void expect_near(const Vector& found, const Vector& expected) {
  EXPECT_NEAR(found.x, expected.x, 1e-12);
  EXPECT_NEAR(found.y, expected.y, 1e-12);
  EXPECT_NEAR(found.z, expected.z, 1e-12);
}

Transform random_transform(std::mt19937_64& random) {
  std::uniform_real_distribution<double> metres(-50.0, 50.0);
  std::uniform_real_distribution<double> angle(-3.0, 3.0);
  return {{metres(random), metres(random), metres(random)},
          from_roll_pitch_yaw(angle(random), angle(random), angle(random))};
}

TEST(ATransform, TakesAPointOfAToB) {
  // The lidar is 2 m before the car's origin and looks to the left.
  const Transform lidar_to_base{{2.0, 0.0, 0.5}, from_roll_pitch_yaw(0.0, 0.0, kQuarter)};

  expect_near(lidar_to_base * Vector{10.0, 0.0, 0.0}, {2.0, 10.0, 0.5});
  expect_near(lidar_to_base.inverse() * Vector{2.0, 10.0, 0.5}, {10.0, 0.0, 0.0});
}

TEST(ATransform, IsAppliedFromRightToLeft) {
  const Transform a_to_b{{1.0, 0.0, 0.0}, {}};
  const Transform b_to_c{{0.0, 0.0, 0.0}, from_roll_pitch_yaw(0.0, 0.0, kQuarter)};

  expect_near(b_to_c * a_to_b * Vector{}, {0.0, 1.0, 0.0});
}

TEST(APositiveYaw, TurnsFromXToY) {
  expect_near(from_roll_pitch_yaw(0.0, 0.0, kQuarter) * Vector{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0});
  expect_near(from_roll_pitch_yaw(0.0, kQuarter, 0.0) * Vector{1.0, 0.0, 0.0}, {0.0, 0.0, -1.0});
  expect_near(from_roll_pitch_yaw(kQuarter, 0.0, 0.0) * Vector{0.0, 1.0, 0.0}, {0.0, 0.0, 1.0});
}

TEST(TransformsInEigen, AreTheSame) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 100; ++i) {
    const Transform a = random_transform(random);
    const Transform b = random_transform(random);
    const Vector point = random_transform(random).translation;
    const Eigen::Vector3d expected = to_eigen(b) * (to_eigen(a) * to_eigen(point));

    EXPECT_NEAR((to_eigen(b * a * point) - expected).norm(), 0.0, 1e-9);
    EXPECT_NEAR((to_eigen(from_eigen(to_eigen(a)) * point) - to_eigen(a) * to_eigen(point)).norm(),
                0.0, 1e-9);
    EXPECT_NEAR((to_eigen(a.inverse() * (a * point)) - to_eigen(point)).norm(), 0.0, 1e-9);
  }
}

TEST(WhatIsInterpolated, TurnsTheShorterWayAtConstantSpeed) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> parts(0.0, 1.0);
  for (int i = 0; i < 1000; ++i) {
    const Transform from = random_transform(random);
    Transform to = random_transform(random);
    if (i % 4 == 0) {  // Nearly the same attitude, where formulas lose digits.
      to.rotation = from_roll_pitch_yaw(0.0, 1e-7 * i, 1e-9 * i) * from.rotation;
    }
    if (i % 3 == 0) {  // The same rotation, written the other way.
      to.rotation = {-to.rotation.w, -to.rotation.x, -to.rotation.y, -to.rotation.z};
    }
    const double part = parts(random);
    const Transform found = interpolate(from, to, part);
    const Eigen::Quaterniond expected = to_eigen(from.rotation).slerp(part, to_eigen(to.rotation));

    EXPECT_NEAR(std::abs(to_eigen(found.rotation).dot(expected)), 1.0, 1e-12);
    EXPECT_NEAR(found.translation.x,
                from.translation.x + part * (to.translation.x - from.translation.x), 1e-9);
  }
}

TEST(WhatIsInterpolated, BeginsAndEndsWithThePoses) {
  std::mt19937_64 random(3);
  const Transform from = random_transform(random);
  const Transform to = random_transform(random);

  expect_near(interpolate(from, to, 0.0) * Vector{1, 2, 3}, from * Vector{1, 2, 3});
  expect_near(interpolate(from, to, 1.0) * Vector{1, 2, 3}, to * Vector{1, 2, 3});
  expect_near(interpolate(from, from, 0.5) * Vector{1, 2, 3}, from * Vector{1, 2, 3});
}

TEST(AMessage, SaysThePoseOfAChild) {
  std::mt19937_64 random(4);
  const Pose pose{.taken = Time(Duration(42)), .child_to_parent = random_transform(random)};
  transform::Transform message;
  to_message("map", "base_link", pose, message);
  const Pose read = from_message(message);

  EXPECT_EQ(message.header().frame(), "map");
  EXPECT_EQ(message.child(), "base_link");
  EXPECT_EQ(read.taken, pose.taken);
  expect_near(read.child_to_parent * Vector{1, 2, 3}, pose.child_to_parent * Vector{1, 2, 3});
  expect_near(from_message(transform::Transform()).child_to_parent * Vector{1, 2, 3}, {1, 2, 3});
}

}  // namespace
}  // namespace fastcycle::transforms

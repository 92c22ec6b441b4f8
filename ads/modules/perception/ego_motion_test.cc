#include "ego_motion.h"

#include <numbers>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr std::int64_t kMs = 1'000'000;

TEST(EgoMotion, WithoutAPoseItKnowsNothing) {
  const EgoMotion motion;

  EXPECT_FALSE(motion.at(0));
}

TEST(EgoMotion, BetweenPosesItMovesEvenlyAndTurnsTheShorterWay) {
  EgoMotion motion;
  motion.add({.time_ns = 0, .position_m = {0.0, 0.0}, .heading_rad = std::numbers::pi - 0.1});
  motion.add(
      {.time_ns = 10 * kMs, .position_m = {1.0, 2.0}, .heading_rad = 0.1 - std::numbers::pi});

  const auto pose = motion.at(5 * kMs);

  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->position_m.x(), 0.5, 1e-12);
  EXPECT_NEAR(pose->position_m.y(), 1.0, 1e-12);
  EXPECT_NEAR(pose->heading_rad, std::numbers::pi, 1e-12);
}

TEST(EgoMotion, GoesOnForAMomentAndNoLonger) {
  EgoMotion motion;
  motion.add({.time_ns = 0, .position_m = {5.0, 0.0}, .speed_mps = 10.0});

  EXPECT_NEAR(motion.at(100 * kMs)->position_m.x(), 6.0, 1e-12);
  EXPECT_NEAR(motion.at(-100 * kMs)->position_m.x(), 4.0, 1e-12);
  EXPECT_FALSE(motion.at(EgoMotion::kReach_ns + 1));
  EXPECT_FALSE(motion.at(-EgoMotion::kReach_ns - 1));
}

TEST(EgoMotion, PoseThatIsNotLaterIsPassedOver) {
  EgoMotion motion;
  motion.add({.time_ns = 10, .position_m = {5.0, 0.0}});
  motion.add({.time_ns = 10, .position_m = {7.0, 0.0}});

  EXPECT_EQ(motion.at(10)->position_m.x(), 5.0);
}

}  // namespace
}  // namespace ads

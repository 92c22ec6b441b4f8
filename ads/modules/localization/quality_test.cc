#include "quality.h"

#include <gtest/gtest.h>

namespace ads {
namespace {

TEST(Quality, WithoutAnyDoubtItIsGood) {
  const Judgement judgement = judge({}, {.since_fix_s = 0.2, .position_stddev_m = 0.2});

  EXPECT_EQ(judgement.quality, localization::GOOD);
  EXPECT_EQ(judgement.reason, "");
}

TEST(Quality, WithoutFixesItIsUncertainAndThenLost) {
  EXPECT_EQ(judge({}, {.since_fix_s = 1.5}).quality, localization::UNCERTAIN);
  EXPECT_EQ(judge({}, {.since_fix_s = 1.5}).reason, "no fix was accepted for 1.5 s");
  EXPECT_EQ(judge({}, {.since_fix_s = 10.5}).quality, localization::LOST);
}

TEST(Quality, RejectedFixesMakeItUncertainAndThenLost) {
  EXPECT_EQ(judge({}, {.rejected = 2}).quality, localization::GOOD);
  EXPECT_EQ(judge({}, {.rejected = 3}).quality, localization::UNCERTAIN);
  EXPECT_EQ(judge({}, {.rejected = 20}).quality, localization::LOST);
  EXPECT_EQ(judge({}, {.rejected = 20}).reason, "20 fixes in a row were rejected");
}

TEST(Quality, LargeCovarianceMakesItUncertainAndThenLost) {
  EXPECT_EQ(judge({}, {.position_stddev_m = 0.8}).quality, localization::UNCERTAIN);
  EXPECT_EQ(judge({}, {.position_stddev_m = 2.0}).quality, localization::LOST);
  EXPECT_EQ(judge({}, {.heading_stddev_rad = 0.05}).quality, localization::UNCERTAIN);
  EXPECT_EQ(judge({}, {.heading_stddev_rad = 0.2}).quality, localization::LOST);
}

TEST(Quality, SilentInputIsALoss) {
  EXPECT_EQ(judge({}, {.since_vehicle_state_s = 0.5}).quality, localization::LOST);
  EXPECT_EQ(judge({}, {.since_motion_s = 0.5}).reason, "no imu/motion for 0.5 s");
}

TEST(Quality, TheWorstCounts) {
  const Judgement judgement = judge({}, {.since_fix_s = 2.0, .position_stddev_m = 2.0});

  EXPECT_EQ(judgement.quality, localization::LOST);
  EXPECT_EQ(judgement.reason, "the position is known to 2.00 m only");
}

}  // namespace
}  // namespace ads

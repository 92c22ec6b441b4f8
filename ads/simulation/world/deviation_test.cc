#include "deviation.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace ads {
namespace {

TEST(Deviation, IsNoneWithoutAShare) {
  const EgoDeviation drawn = draw_deviation(0.0, 17);
  const EgoDeviation none;

  EXPECT_EQ(drawn.steering_gain, none.steering_gain);
  EXPECT_EQ(drawn.understeer_s2_per_m2, none.understeer_s2_per_m2);
  EXPECT_EQ(drawn.force_gain, none.force_gain);
  EXPECT_EQ(drawn.resistance_mps2, none.resistance_mps2);
  EXPECT_EQ(drawn.acceleration_lag_s, none.acceleration_lag_s);
  EXPECT_EQ(drawn.steering_lag_s, none.steering_lag_s);
  EXPECT_EQ(drawn.speed_gain, none.speed_gain);
}

TEST(Deviation, OfOneSeedIsTheSameAndOfAnotherOneIsNot) {
  EXPECT_EQ(draw_deviation(1.0, 3).force_gain, draw_deviation(1.0, 3).force_gain);
  EXPECT_NE(draw_deviation(1.0, 3).force_gain, draw_deviation(1.0, 4).force_gain);
}

TEST(Deviation, FillsItsBoundsAndKeepsThem) {
  double lowest = 1.0;
  double highest = 1.0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    const EgoDeviation drawn = draw_deviation(1.0, seed);
    lowest = std::min(lowest, drawn.force_gain);
    highest = std::max(highest, drawn.force_gain);
    EXPECT_GE(drawn.understeer_s2_per_m2, 0.0);
    EXPECT_LE(drawn.understeer_s2_per_m2, 0.002);
    EXPECT_GE(drawn.speed_gain, 0.98);
    EXPECT_LE(drawn.speed_gain, 1.02);
  }
  EXPECT_NEAR(lowest, 0.85, 0.01);
  EXPECT_NEAR(highest, 1.15, 0.01);
}

}  // namespace
}  // namespace ads

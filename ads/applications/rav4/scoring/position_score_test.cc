#include "position_score.h"

#include <gtest/gtest.h>

namespace rav4 {
namespace {

using std::chrono_literals::operator""ms;

const ads::GeodeticPosition kOrigin{
    .latitude_deg = 37.72, .longitude_deg = -122.47, .altitude_m = 30.0};

// A car that drives east at 10 m/s, with a frame every 50 ms.
Reference eastward() {
  const ads::LocalFrame plane(kOrigin);
  std::vector<Reference::Frame> frames;
  for (int frame = 0; frame <= 20; ++frame) {
    frames.push_back(
        {.offset = frame * 50ms, .ecef_m = plane.ecef_from_enu({0.5 * frame, 0.0, 0.0})});
  }
  return Reference(std::move(frames));
}

TEST(PositionScore, FixIsComparedAtItsArrival) {
  PositionScore score(eastward());

  const auto comparison = score.on_fix(100ms, kOrigin);

  ASSERT_TRUE(comparison);
  EXPECT_NEAR(comparison->error_m(), 1.0, 1e-6);
  EXPECT_NEAR(score.fix_errors().mean_m(), 1.0, 1e-6);
}

TEST(PositionScore, FixOutsideOfTheReferenceIsNotCompared) {
  PositionScore score(eastward());

  EXPECT_FALSE(score.on_fix(2000ms, kOrigin));
  EXPECT_EQ(score.fix_errors().count, 0);
}

TEST(PositionScore, EstimateIsCarriedOnToTheFrames) {
  PositionScore score(eastward());
  score.on_fix(0ms, kOrigin);
  score.on_motion({.offset = 20ms, .position_m = {0.2, 0.0}, .velocity_mps = {10.0, 0.0}});

  const auto compared = score.on_motion({.offset = 120ms, .position_m = {9.0, 9.0}});

  ASSERT_EQ(compared.size(), 2U);
  EXPECT_EQ(compared[0].offset, 50ms);
  EXPECT_NEAR(compared[1].error_m(), 0.0, 1e-6);
}

TEST(PositionScore, LaterEstimateHasNoPart) {
  PositionScore score(eastward());
  score.on_fix(0ms, kOrigin);
  score.on_motion({.offset = 40ms, .position_m = {3.5, 0.0}});

  const auto compared = score.on_motion({.offset = 60ms, .position_m = {0.6, 0.0}});

  ASSERT_EQ(compared.size(), 1U);
  EXPECT_NEAR(compared[0].error_m(), 3.0, 1e-6);
}

TEST(PositionScore, FramesBeforeTheFirstFixDoNotCount) {
  PositionScore score(eastward());
  score.on_fix(310ms, kOrigin);
  score.on_motion({.offset = 320ms, .position_m = {}});

  score.on_motion({.offset = 410ms, .position_m = {}});

  EXPECT_EQ(score.estimate_errors().count, 2);
}

TEST(PositionScore, LastEstimateIsCarriedOnOnlyShortly) {
  PositionScore score(eastward());
  score.on_fix(0ms, kOrigin);
  score.on_motion({.offset = 0ms, .position_m = {}});

  score.finish();

  EXPECT_EQ(score.estimate_errors().count, 2);
}

}  // namespace
}  // namespace rav4

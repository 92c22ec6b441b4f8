#include "lane_map.h"

#include <numbers>

#include <gtest/gtest.h>

#include "small_map.h"

namespace ads {
namespace {

TEST(LaneMap, PlaceIsOnItsLane) {
  const LaneMap lanes(testing::small_map());

  const auto place = lanes.match({30.0, 4.0}, 0.05, 10.0, 0);

  ASSERT_TRUE(place);
  EXPECT_EQ(place->lane, 2);
  EXPECT_NEAR(place->along_m, 30.0, 1e-9);
  EXPECT_NEAR(place->offset_m, 0.5, 1e-9);
}

TEST(LaneMap, DirectionDecides) {
  const LaneMap lanes(testing::small_map());

  EXPECT_EQ(lanes.match({150.0, 0.2}, 0.0, 10.0, 0)->lane, 11);
  EXPECT_EQ(lanes.match({150.0, 0.2}, 1.5, 10.0, 0)->lane, 5);
  EXPECT_EQ(lanes.match({30.0, 7.0}, std::numbers::pi, 10.0, 0)->lane, 3);
  EXPECT_FALSE(lanes.match({30.0, 0.0}, std::numbers::pi, 10.0, 0));
  EXPECT_EQ(lanes.match({30.0, 0.0}, std::numbers::pi, 0.0, 0)->lane, 1);
}

TEST(LaneMap, LaneIsKeptUntilAnotherOneFitsClearlyBetter) {
  const LaneMap lanes(testing::small_map());

  EXPECT_EQ(lanes.match({30.0, 1.9}, 0.0, 10.0, 0)->lane, 2);
  EXPECT_EQ(lanes.match({30.0, 1.9}, 0.0, 10.0, 1)->lane, 1);
  EXPECT_EQ(lanes.match({30.0, 2.6}, 0.0, 10.0, 1)->lane, 2);
}

TEST(LaneMap, LanesOfTheRouteArePreferred) {
  const LaneMap lanes(testing::small_map());

  EXPECT_EQ(lanes.match({150.0, 0.2}, 0.7, 10.0, 0)->lane, 11);
  EXPECT_EQ(lanes.match({150.0, 0.2}, 0.7, 10.0, 0, {5})->lane, 5);
  EXPECT_EQ(lanes.match({150.0, 0.2}, 0.0, 10.0, 0, {5})->lane, 11);
}

TEST(LaneMap, FarFromAllLanesIsNoLane) {
  const LaneMap lanes(testing::small_map());

  EXPECT_FALSE(lanes.match({30.0, -20.0}, 0.0, 10.0, 1));
  EXPECT_EQ(lanes.match({-20.0, 0.0}, 0.0, 10.0, 0)->lane, 1);
  EXPECT_FALSE(LaneMap().match({0.0, 0.0}, 0.0, 10.0, 0));
}

}  // namespace
}  // namespace ads

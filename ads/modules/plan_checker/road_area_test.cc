#include "road_area.h"

#include <limits>

#include <gtest/gtest.h>

#include "example_plan.h"

namespace plan_checker {
namespace {

TEST(RoadArea, LanesSideBySideAreOneArea) {
  const RoadArea road(two_lanes());

  EXPECT_EQ(road.beyond_m({10.0, 1.75}), 0.0);
  EXPECT_EQ(road.beyond_m({10.0, 5.2}), 0.0);
  EXPECT_NEAR(road.beyond_m({10.0, 5.75}), 0.5, 1e-9);
  EXPECT_NEAR(road.beyond_m({10.0, -3.75}), 2.0, 1e-9);
  EXPECT_NEAR(road.beyond_m({10.0, -51.75}), 50.0, 1e-9);
  EXPECT_NEAR(road.beyond_m({10.0, -301.75}), 300.0, 1e-9);
}

TEST(RoadArea, LaneGoesOnStraightWhereTheMapEnds) {
  hd_map::Tile tile = two_lanes();
  EXPECT_EQ(RoadArea(tile).beyond_m({450.0, 0.0}), 0.0);
  for (hd_map::Lane& lane : *tile.mutable_lanes()) {
    lane.add_successors(3);
  }
  EXPECT_NEAR(RoadArea(tile).beyond_m({450.0, 0.0}), 50.0, 1e-9);
}

TEST(RoadArea, CrossingsForPedestriansAreNoRoad) {
  hd_map::Tile tile;
  add_lane(tile, 1, -1.75, 1.75, 0.0);
  tile.mutable_lanes(0)->set_type(hd_map::CROSSING);

  EXPECT_TRUE(RoadArea(tile).is_empty());
}

TEST(RoadArea, LaneWithANumberThatIsNotFiniteIsLeftOut) {
  hd_map::Tile tile;
  add_lane(tile, 1, -1.75, std::numeric_limits<double>::quiet_NaN(), 0.0);

  EXPECT_TRUE(RoadArea(tile).is_empty());
}

TEST(RoadArea, LimitIsThatOfTheLanesInTheVehiclesDirection) {
  hd_map::Tile tile;
  add_lane(tile, 1, -1.75, 1.75, 10.0);
  add_lane(tile, 2, -1.75, 1.75, 20.0, 400.0, -200.0);  // The other way.
  const RoadArea road(tile);

  EXPECT_EQ(road.speed_limit({10.0, 0.0}, 0.0)->mps, 10.0);
  EXPECT_EQ(road.speed_limit({10.0, 0.0}, 0.0)->lane, 1);
  EXPECT_EQ(road.speed_limit({10.0, 0.0}, 3.14)->mps, 20.0);
  EXPECT_FALSE(road.speed_limit({10.0, 0.0}, 1.57).has_value());
  EXPECT_FALSE(road.speed_limit({10.0, 9.0}, 0.0).has_value());
}

TEST(RoadArea, WhereALaneHasNoLimitThereIsNone) {
  EXPECT_FALSE(RoadArea(two_lanes(0.0)).speed_limit({10.0, 0.0}, 0.0).has_value());
}

TEST(RoadArea, SaysNothingFarFromTheTilesMiddle) {
  hd_map::Tile tile = two_lanes();
  tile.set_radius_m(50.0);

  EXPECT_TRUE(RoadArea(tile).covers({40.0, 0.0}));
  EXPECT_FALSE(RoadArea(tile).covers({60.0, 0.0}));
}

}  // namespace
}  // namespace plan_checker

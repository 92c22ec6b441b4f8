#include "traffic.h"

#include <gtest/gtest.h>

#include "straight_road.h"

namespace motion_planning {
namespace {

constexpr std::size_t kSteps = 40;
constexpr double kHorizon_s = 8.0;

std::vector<State> far_away() {
  return {{.x_m = -1000.0}};
}

double along_at_end(const TrafficObject& object) {
  return state_at(object.ways[0], kHorizon_s).x_m;
}

TEST(PredictedWay, IsInterpolatedAndGoesOnBeyondItsEnds) {
  const PredictedWay way{
      .first_s = -0.1,
      .step_s = 0.2,
      .states = {{.x_m = 0.0, .speed_mps = 10.0}, {.x_m = 2.0, .speed_mps = 10.0}}};

  EXPECT_NEAR(state_at(way, -0.1).x_m, 0.0, 1e-12);
  EXPECT_NEAR(state_at(way, 0.0).x_m, 1.0, 1e-12);
  EXPECT_NEAR(state_at(way, 1.1).x_m, 12.0, 1e-9);
}

TEST(Traffic, HasEachWayAtEachStep) {
  TrafficObject object = car(0.0, 0.0, 10.0);
  object.ways[0].probability = 0.7;
  object.ways.push_back(object.ways[0]);
  object.ways[1].probability = 0.3;
  const Traffic traffic({object}, kSteps);

  ASSERT_EQ(traffic.steps(), kSteps);
  ASSERT_EQ(traffic.at(10).size(), 2U);
  EXPECT_NEAR(traffic.at(10)[0].x_m, 20.0, 1e-9);
}

TEST(Traffic, SpacesLieWithinEachOther) {
  for (const double speed : {0.0, 5.0, 30.0}) {
    const Traffic traffic({car(0.0, 0.0, speed)}, kSteps);
    for (const std::size_t step : {std::size_t{0}, kSteps}) {
      const Occupant& occupant = traffic.at(step).at(0);
      for (std::size_t index = 0; index + 1 < occupant.spaces.size(); ++index) {
        EXPECT_GE(occupant.spaces[index].along_m, occupant.spaces[index + 1].along_m);
        EXPECT_GE(occupant.spaces[index].beside_m, occupant.spaces[index + 1].beside_m);
      }
    }
  }
}

TEST(Queues, FasterCarStaysBehindTheSlowerOne) {
  const auto objects = in_queues({car(0.0, 0.0, 15.0), car(30.0, 0.0, 5.0)}, straight_road(),
                                 Vehicle{}, far_away(), kHorizon_s);

  EXPECT_NEAR(along_at_end(objects[1]), 70.0, 1e-6);
  EXPECT_LT(along_at_end(objects[0]), 70.0 - 4.5);
  EXPECT_GT(along_at_end(objects[0]), 40.0);
}

TEST(Queues, CarInAnotherLaneDrivesOn) {
  const auto objects = in_queues({car(0.0, kLane_m, 15.0), car(30.0, 0.0, 5.0)}, straight_road(),
                                 Vehicle{}, far_away(), kHorizon_s);

  EXPECT_NEAR(along_at_end(objects[0]), 120.0, 1e-6);
}

TEST(Queues, NoCarIsItsOwnLeader) {
  TrafficObject object = car(0.0, 0.0, 5.0);
  object.ways[0].probability = 0.8;
  object.ways.push_back(object.ways[0]);
  object.ways[1].probability = 0.2;
  const auto objects = in_queues({object}, straight_road(), Vehicle{}, far_away(), kHorizon_s);

  for (const PredictedWay& way : objects[0].ways) {
    EXPECT_NEAR(state_at(way, kHorizon_s).x_m, 5.0 * kHorizon_s, 1e-6);
  }
}

TEST(Queues, WhoIsBehindLeavesRoomForTheVehicle) {
  const std::vector<TrafficObject> cars = {car(0.0, 0.0, 5.0), car(40.0, 0.0, 0.0)};
  std::vector<State> ego(kSteps + 1, State{.x_m = 25.0});
  const auto with = in_queues(cars, straight_road(), Vehicle{}, ego, kHorizon_s);
  const auto without = in_queues(cars, straight_road(), Vehicle{}, far_away(), kHorizon_s);

  EXPECT_LT(along_at_end(with[0]) + 4.508, along_at_end(without[0]));
}

TEST(Queues, NobodyReactsToTheVehicleAtOnce) {
  std::vector<State> ego(kSteps + 1, State{.x_m = 12.0});
  const auto objects =
      in_queues({car(0.0, 0.0, 10.0)}, straight_road(), Vehicle{}, ego, kHorizon_s);

  EXPECT_NEAR(state_at(objects[0].ways[0], 1.4).x_m, 14.0, 1e-6);
  EXPECT_LT(along_at_end(objects[0]), 40.0);
}

}  // namespace
}  // namespace motion_planning

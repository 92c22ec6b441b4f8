#include "give_way.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "straight_road.h"

namespace motion_planning {
namespace {

constexpr std::size_t kSteps = 40;
constexpr double kHalfLength_m = 4.508 / 2.0;
constexpr std::int64_t kLane = 5;

// Drives across the road, where x is 50 m, and is `away_m` from the vehicle's line.
TrafficObject crossing(double away_m, double speed_mps, bool goes_first = true) {
  TrafficObject object = car(50.0, -away_m, speed_mps, 7);
  object.ways[0].states[0].heading_rad = 0.5 * std::numbers::pi;
  object.goes_first = goes_first;
  return object;
}

class GiveWayTest : public ::testing::Test {
 protected:
  // The vehicle is at x = 0 m; the line at x = 40 m.
  std::optional<Halt> halt(const std::vector<TrafficObject>& objects, double speed_mps = 10.0,
                           double x_m = 0.0) {
    const Traffic traffic(objects, kSteps);
    const Problem problem{.vehicle = vehicle_,
                          .road = road_,
                          .traffic = traffic,
                          .start = {.x_m = x_m, .speed_mps = speed_mps},
                          .cruise_mps = 10.0};
    return halt_before(problem, traffic, objects, lines_, stood_at_lane_);
  }

  const Vehicle vehicle_;
  const Road road_ = straight_road();
  std::vector<WaitingLine> lines_ = {{.lane = kLane, .along_m = 90.0}};
  std::optional<std::int64_t> stood_at_lane_;
};

TEST_F(GiveWayTest, WithoutAnyoneThereIsNoHalt) {
  EXPECT_FALSE(halt({}));
}

TEST_F(GiveWayTest, WhoComesAtTheSameTimeIsGivenWay) {
  const auto found = halt({crossing(50.0, 10.0)});

  ASSERT_TRUE(found);
  EXPECT_EQ(found->kind, RuleKind::kGiveWay);
  EXPECT_EQ(found->object, 7U);
  EXPECT_EQ(found->line_m, 90.0);
  EXPECT_NEAR(found->along_m, 90.0 - kHalfLength_m - kBeforeLine_m, 1e-9);
}

TEST_F(GiveWayTest, WhoDoesNotGoFirstIsNotGivenWay) {
  EXPECT_FALSE(halt({crossing(50.0, 10.0, false)}));
}

TEST_F(GiveWayTest, WhoMayComeInSeveralWaysIsGivenWayIfTheyAreProbableTogether) {
  TrafficObject object = crossing(50.0, 10.0);
  object.ways[0].probability = 0.12;
  EXPECT_FALSE(halt({object}));
  object.ways.push_back(object.ways[0]);
  object.ways[1].states[0].speed_mps = 9.5;
  EXPECT_TRUE(halt({object}));
}

TEST_F(GiveWayTest, WithoutALineThereIsNoHalt) {
  lines_.clear();
  EXPECT_FALSE(halt({crossing(50.0, 10.0)}));
}

TEST_F(GiveWayTest, WhoStandsDoesNotPullOutBeforeOthersAlsoWithoutALine) {
  lines_.clear();

  const auto found = halt({crossing(25.0, 10.0)}, 0.0, 43.0);

  ASSERT_TRUE(found);
  EXPECT_EQ(found->kind, RuleKind::kGiveWay);
  EXPECT_EQ(found->along_m, 93.0);
  EXPECT_FALSE(halt({crossing(25.0, 10.0)}, 2.0, 43.0)) << "It is on its way already.";
  EXPECT_FALSE(halt({crossing(25.0, 10.0, false)}, 0.0, 43.0));
  EXPECT_FALSE(halt({crossing(90.0, 10.0)}, 0.0, 43.0)) << "The other one is far away.";
}

TEST_F(GiveWayTest, VehiclePassesBeforeWhoIsFar) {
  EXPECT_FALSE(halt({crossing(78.0, 10.0)}));
}

TEST_F(GiveWayTest, VehiclePassesBehindWhoIsGoneBefore) {
  EXPECT_FALSE(halt({crossing(10.0, 10.0)}));
}

TEST_F(GiveWayTest, WhoJoinsTheRoadIsGivenWay) {
  TrafficObject joining = crossing(0.0, 10.0);
  joining.ways[0].states.clear();
  joining.ways[0].step_s = 1.0;
  // Comes from the side, turns, and goes on along the road at x = 53 m.
  for (int second = 0; second < 9; ++second) {
    const double time = second;
    joining.ways[0].states.push_back({.x_m = second < 4 ? 50.0 : 53.0 + 5.0 * (time - 4.0),
                                      .y_m = second < 4 ? -20.0 + 5.0 * time : 0.0,
                                      .heading_rad = second < 4 ? 0.5 * std::numbers::pi : 0.0,
                                      .speed_mps = 5.0});
  }
  EXPECT_TRUE(halt({joining}, 10.0, 8.0));
  // Behind him there is room.
  EXPECT_FALSE(halt({joining}));
}

TEST_F(GiveWayTest, LineBeforeWhichTheVehicleCannotStopIsNone) {
  EXPECT_FALSE(halt({crossing(30.0, 10.0)}, 10.0, 30.0));
  EXPECT_TRUE(halt({crossing(30.0, 10.0)}, 3.0, 30.0));
}

TEST_F(GiveWayTest, LineThatWasPassedIsNone) {
  EXPECT_FALSE(halt({crossing(35.0, 10.0)}, 1.5, 38.5));
  EXPECT_TRUE(halt({crossing(35.0, 10.0)}, 0.0, 36.0));
}

TEST_F(GiveWayTest, BrakingIsAsHardAsItHasToBe) {
  EXPECT_EQ(halt({crossing(50.0, 10.0)})->braking_mps2, SpeedProfile::kBraking_mps2);
  EXPECT_GT(halt({crossing(25.0, 10.0)}, 10.0, 15.0)->braking_mps2, 2.5);
}

TEST_F(GiveWayTest, StopSignAsksForAStopOnce) {
  lines_[0].is_stop_sign = true;
  const auto found = halt({});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->kind, RuleKind::kStopLine);

  stood_at_lane_ = kLane;
  EXPECT_FALSE(halt({}));
}

TEST_F(GiveWayTest, WhoHasStoodStillGivesWay) {
  lines_[0].is_stop_sign = true;
  stood_at_lane_ = kLane;
  const auto found = halt({crossing(35.0, 10.0)}, 0.0, 36.5);

  ASSERT_TRUE(found);
  EXPECT_EQ(found->kind, RuleKind::kGiveWay);
}

TEST_F(GiveWayTest, VehicleHasStoodWhenItStandsNearTheLine) {
  const auto stood = [&](double gap_m, double speed_mps,
                         const std::optional<std::int64_t>& before = {}) {
    const State ego{.x_m = 40.0 - kHalfLength_m - gap_m, .speed_mps = speed_mps};
    return stood_at(road_, vehicle_, ego, lines_, before);
  };

  EXPECT_FALSE(stood(5.0, 0.0));
  EXPECT_FALSE(stood(1.0, 0.5));
  EXPECT_EQ(stood(1.0, 0.05), kLane);
  // It goes on to be so until the line is left behind.
  EXPECT_EQ(stood(0.5, 1.0, kLane), kLane);
  EXPECT_EQ(stood(-4.0, 3.0, kLane), kLane);
  EXPECT_FALSE(stood(-6.0, 4.0, kLane));
}

}  // namespace
}  // namespace motion_planning

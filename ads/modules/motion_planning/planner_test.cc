#include "planner.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "straight_road.h"

namespace motion_planning {
namespace {

class PlannerTest : public ::testing::Test {
 protected:
  Plan plan(double now_s = 0.0) {
    Situation situation{.now_s = now_s,
                        .ego = ego_,
                        .is_driving = is_driving_,
                        .road = &road_,
                        .objects = objects_,
                        .hazards = hazards_,
                        .waiting_lines = lines_,
                        .map_end_m = map_end_m_,
                        .goal = goal_};
    return planner_.plan(situation);
  }
  // Plans as often as an application does, and drives what was planned.
  void drive_for(double seconds) {
    is_driving_ = true;
    for (int cycle = 0; cycle < std::lround(10.0 * seconds); ++cycle) {
      const double now = 0.1 * cycle;
      const Plan plan = this->plan(now);
      ego_ = plan.nominal.at(now + 0.1);
      if (ego_.speed_mps < 0.1) {
        stood_m_ = ego_.x_m;
      }
      hardest_mps2_ = std::min(hardest_mps2_, ego_.acceleration_mps2);
      for (TrafficObject& object : objects_) {
        PredictedState& state = object.ways[0].states[0];
        state.x_m += 0.1 * state.speed_mps;
      }
      last_ = plan;
    }
  }
  static Goal goal_at(double x_m, double y_m) {
    return {.centre = {.x_m = x_m, .y_m = y_m},
            .half_length_m = 1.0,
            .half_width_m = 0.8,
            .heading_rad = {-0.09, 0.09},
            .speed_mps = {7.0, 13.0},
            .time_s = {6.0, 7.0}};
  }

  Planner planner_{PlannerConfig{}};
  Road road_ = straight_road();
  State ego_{.speed_mps = 10.0};
  bool is_driving_ = false;
  std::vector<TrafficObject> objects_;
  std::vector<HazardArea> hazards_;
  std::vector<WaitingLine> lines_;
  std::optional<double> map_end_m_;
  std::optional<Goal> goal_;
  Plan last_;
  double hardest_mps2_ = 0.0;
  std::optional<double> stood_m_;  // Where the vehicle has stood last.
};

TEST_F(PlannerTest, WithoutLimitItGoesWithTheOthers) {
  objects_ = {car(40.0, kLane_m, 18.0), car(-30.0, -kLane_m, 18.0, 2)};
  EXPECT_GT(plan().nominal.states.back().speed_mps, 13.0);
  road_ = straight_road(7.0);
  EXPECT_LT(plan().nominal.states.back().speed_mps, 7.0 + SpeedProfile::kTolerance_mps);
}

TEST_F(PlannerTest, KeepsTheLimitAndSaysThatItBinds) {
  road_ = straight_road(10.5);
  goal_ = goal_at(100.0, 0.0);
  const Plan made = plan();

  for (const State& state : made.nominal.states) {
    EXPECT_LT(state.speed_mps, 10.5 + SpeedProfile::kTolerance_mps);
  }
  ASSERT_EQ(made.binding_rules.size(), 1U);
  EXPECT_EQ(made.binding_rules[0].rule.kind, RuleKind::kSpeedLimit);
  EXPECT_EQ(made.binding_rules[0].rule.speed_mps, 10.5);
  EXPECT_GT(made.binding_rules[0].time_s, 0.0);
}

TEST_F(PlannerTest, NoRuleBindsWhoIsSlowerThanAllOfThem) {
  road_ = straight_road(20.0);
  goal_ = goal_at(66.0, 0.0);

  EXPECT_TRUE(plan().binding_rules.empty());
}

TEST_F(PlannerTest, BrakesComfortablyToTheLimitFromAbove) {
  road_ = straight_road(8.0);
  ego_.speed_mps = 14.0;
  drive_for(6.0);

  EXPECT_NEAR(ego_.speed_mps, 8.0, SpeedProfile::kTolerance_mps);
  EXPECT_GT(hardest_mps2_, -SpeedProfile::kBraking_mps2 - 0.7);
}

TEST_F(PlannerTest, StopsAtAStopSignAndGoesOn) {
  lines_ = {{.lane = 5, .along_m = 100.0, .is_stop_sign = true}};  // x = 50 m.
  const Plan first = plan();
  ASSERT_FALSE(first.binding_rules.empty());
  EXPECT_EQ(first.binding_rules[0].rule.kind, RuleKind::kStopLine);
  EXPECT_NEAR(first.binding_rules[0].place.x_m, 50.0, 1e-6);
  drive_for(20.0);

  ASSERT_TRUE(stood_m_);
  const double front = *stood_m_ + Vehicle().length_m / 2.0;
  EXPECT_GT(front, 48.0);
  EXPECT_LT(front, 50.0);
  EXPECT_GT(ego_.x_m, 60.0);
}

TEST_F(PlannerTest, WithoutAGoalItStopsBeforeTheEndOfTheMap) {
  map_end_m_ = road_.locate(60.0, 0.0).along_m;
  drive_for(14.0);

  ASSERT_TRUE(stood_m_);
  EXPECT_NEAR(*stood_m_, 60.0 - Vehicle{}.length_m / 2.0 - kBeforeLine_m, 1.0);
}

TEST_F(PlannerTest, WaitsBeforeTheLineForWhoGoesFirst) {
  lines_ = {{.lane = 5, .along_m = 100.0}};
  objects_ = {car(60.0, -45.0, 8.0, 7)};
  objects_[0].goes_first = true;
  objects_[0].ways[0].states[0].heading_rad = std::asin(1.0);
  const Plan made = plan();

  ASSERT_FALSE(made.binding_rules.empty());
  EXPECT_EQ(made.binding_rules[0].rule.kind, RuleKind::kGiveWay);
  EXPECT_EQ(made.binding_rules[0].rule.object, 7U);
  for (const State& state : made.nominal.states) {
    EXPECT_LT(state.x_m + Vehicle().length_m / 2.0, 50.0);
  }
}

TEST_F(PlannerTest, GoesOnPullingOutAsLongAsThereIsRoom) {
  ego_ = {};
  const auto goes_after = [this](bool had_decided) {
    Planner planner{PlannerConfig{}};
    Situation situation{.ego = ego_, .is_driving = true, .road = &road_};
    if (had_decided) {
      planner.plan(situation);
    }
    // Has right of way, and is gone when the vehicle has driven off gently.
    TrafficObject object = car(7.0, -13.0, 8.0);
    object.ways[0].states[0].heading_rad = 0.5 * std::numbers::pi;
    object.goes_first = true;
    situation.objects = {object};
    situation.now_s = 0.1;
    return planner.plan(situation).nominal.at(2.5).speed_mps;
  };

  EXPECT_LT(goes_after(false), 0.3);
  EXPECT_GT(goes_after(true), 1.0);
}

TEST_F(PlannerTest, ReachesTheGoalStateOnAFreeRoad) {
  goal_ = goal_at(66.0, kLane_m);
  const Plan made = plan();

  EXPECT_EQ(made.kind, PlanKind::kNominal);
  ASSERT_TRUE(made.goal_s);
  EXPECT_GE(*made.goal_s, 6.0);
  EXPECT_LE(*made.goal_s, 7.0);
  EXPECT_EQ(made.reason, "");
  EXPECT_TRUE(std::isinf(made.smallest_gap_m));
}

TEST_F(PlannerTest, ReachesAGoalThatIsUncomfortable) {
  goal_ = goal_at(55.0, 1.0);
  goal_->heading_rad = {0.7, 0.8};
  goal_->speed_mps = {7.0, 9.0};

  const Plan made = plan();

  EXPECT_EQ(made.kind, PlanKind::kNominal);
  ASSERT_TRUE(made.goal_s) << made.reason;
  EXPECT_GT(made.nominal.at(*made.goal_s).heading_rad, 0.7);
}

TEST_F(PlannerTest, SaysByWhatTheGoalIsMissed) {
  goal_ = goal_at(150.0, 0.0);
  const Plan made = plan();

  EXPECT_FALSE(made.goal_s);
  EXPECT_NE(made.reason.find("the goal is missed by"), std::string::npos) << made.reason;
}

TEST_F(PlannerTest, BeginsWithWhatIsUnderWay) {
  ego_.acceleration_mps2 = -1.0;
  const Plan made = plan();

  EXPECT_EQ(made.nominal.states[0], ego_);
  EXPECT_NEAR(made.nominal.at(0.2).speed_mps, 9.8, 1e-9);
}

TEST_F(PlannerTest, ContinuesItsLastPlan) {
  goal_ = goal_at(66.0, kLane_m);
  const Plan first = plan(0.0);
  is_driving_ = true;
  ego_ = first.nominal.at(0.1);
  ego_.y_m += 0.2;  // Localization does not quite agree.
  const Plan second = plan(0.1);

  EXPECT_NEAR(second.nominal.at(0.1).y_m, first.nominal.at(0.1).y_m, 1e-9);
  EXPECT_NEAR(second.nominal.at(1.0).y_m, first.nominal.at(1.0).y_m, 0.05);
  EXPECT_NEAR(second.nominal.at(3.0).y_m, first.nominal.at(3.0).y_m, 0.3);
}

TEST_F(PlannerTest, BeginsAnewWhereTheVehicleIsWhenItDoesNotFollow) {
  plan(0.0);
  is_driving_ = true;
  ego_ = {.x_m = 1.0, .y_m = 2.0, .speed_mps = 7.0};
  const Plan second = plan(0.1);

  EXPECT_EQ(second.nominal.states[0], ego_);
}

TEST_F(PlannerTest, AlwaysHasAStopAtHand) {
  objects_ = {car(40.0, 0.0, 8.0)};
  const Plan made = plan();

  EXPECT_EQ(made.minimal_risk.states.back().speed_mps, 0.0);
  EXPECT_LT(made.minimal_risk.duration_s(), 12.0);
}

TEST_F(PlannerTest, BrakesHardForWhatAppearsRightAhead) {
  objects_ = {car(14.0, 0.0, 0.0, 1), car(14.0, kLane_m, 0.0, 2), car(14.0, -kLane_m, 0.0, 3)};
  const Plan made = plan();

  EXPECT_NE(made.kind, PlanKind::kNominal);
  EXPECT_LT(made.nominal.at(0.9).acceleration_mps2, -6.0);
}

TEST_F(PlannerTest, BrakesHardToStayOnTheRoad) {
  // A bend of 12 m radius, 8 m ahead of a vehicle with 14 m/s.
  std::vector<RoadPoint> points;
  for (double along = -60.0; along < 80.0; along += 1.0) {
    constexpr double kBegin_m = 8.0;
    constexpr double kRadius_m = 12.0;
    const double angle = std::clamp((along - kBegin_m) / kRadius_m, 0.0, 1.5);
    const double rest_m = std::max(0.0, along - kBegin_m - 1.5 * kRadius_m);
    points.push_back(
        {.x_m = std::min(along, kBegin_m) + kRadius_m * std::sin(angle) + rest_m * std::cos(angle),
         .y_m = kRadius_m * (1.0 - std::cos(angle)) + rest_m * std::sin(angle),
         .left_edge_m = 1.75,
         .right_edge_m = 1.75});
  }
  road_ = Road(points);
  ego_.speed_mps = 14.0;
  const Plan made = plan();

  EXPECT_EQ(made.kind, PlanKind::kEvasive);
  EXPECT_NE(made.reason.find("the road would be left"), std::string::npos) << made.reason;
  EXPECT_LT(made.nominal.at(0.9).acceleration_mps2, -5.5);
}

TEST_F(PlannerTest, DoesNotDriveOverAClosedPlace) {
  hazards_ = {{.x_m = 60.0, .y_m = 0.0, .radius_m = 6.0, .speed_mps = 0.0}};
  const Plan made = plan();

  for (const State& state : made.nominal.states) {
    EXPECT_TRUE(std::abs(state.x_m - 60.0) > 5.5 || std::abs(state.y_m) > 5.5);
  }
}

TEST_F(PlannerTest, SlowsDownForAHazard) {
  hazards_ = {{.x_m = 50.0, .y_m = 0.0, .radius_m = 10.0, .speed_mps = 4.0}};
  const Plan made = plan();

  for (const State& state : made.nominal.states) {
    EXPECT_TRUE(std::abs(state.x_m - 50.0) > 10.0 ||
                state.speed_mps < 4.0 + SpeedProfile::kTolerance_mps);
  }
  ASSERT_FALSE(made.binding_rules.empty());
  EXPECT_EQ(made.binding_rules[0].rule.kind, RuleKind::kHazard);
  EXPECT_NEAR(made.binding_rules[0].ahead_m, 40.0, 1.0);
}

TEST_F(PlannerTest, DrivesByACarThatStands) {
  objects_ = {car(45.0, 0.0, 0.0)};
  goal_ = goal_at(66.0, 0.0);
  drive_for(6.5);

  EXPECT_GT(last_.smallest_gap_m, 0.5);
  EXPECT_NEAR(ego_.x_m, 66.0, 5.0);
}

TEST_F(PlannerTest, PlansTheSameInAnotherPlaceAndDirection) {
  goal_ = goal_at(66.0, kLane_m);
  objects_ = {car(20.0, 0.0, 7.0)};
  const Plan here = plan();

  // Turned by a quarter to the left, and moved far away.
  const auto moved = [](double x, double y) { return std::pair(4e5 - y, -3e5 + x); };
  std::vector<RoadPoint> points;
  for (double x = -50.0; x <= 400.0; x += 5.0) {
    const auto [there_x, there_y] = moved(x, 0.0);
    points.push_back({.x_m = there_x,
                      .y_m = there_y,
                      .left_edge_m = 1.5 * kLane_m,
                      .right_edge_m = 1.5 * kLane_m});
  }
  road_ = Road(points);
  for (const double offset : {-kLane_m, 0.0, kLane_m}) {
    const auto [from_x, from_y] = moved(-50.0, offset);
    const auto [to_x, to_y] = moved(400.0, offset);
    road_.add_lane({{from_x, from_y}, {to_x, to_y}});
  }
  const double quarter = std::asin(1.0);
  std::tie(ego_.x_m, ego_.y_m) = moved(0.0, 0.0);
  ego_.heading_rad = quarter;
  std::tie(goal_->centre.x_m, goal_->centre.y_m) = moved(66.0, kLane_m);
  goal_->centre.heading_rad += quarter;
  goal_->heading_rad.low += quarter;
  goal_->heading_rad.high += quarter;
  PredictedState& state = objects_[0].ways[0].states[0];
  std::tie(state.x_m, state.y_m) = moved(20.0, 0.0);
  state.heading_rad = quarter;
  const Plan there = Planner(PlannerConfig{})
                         .plan({.now_s = 0.0,
                                .ego = ego_,
                                .is_driving = false,
                                .road = &road_,
                                .objects = objects_,
                                .hazards = {},
                                .goal = goal_});

  const auto [x, y] = moved(here.nominal.at(5.0).x_m, here.nominal.at(5.0).y_m);
  EXPECT_NEAR(there.nominal.at(5.0).x_m, x, 0.01);
  EXPECT_NEAR(there.nominal.at(5.0).y_m, y, 0.01);
  EXPECT_TRUE(there.goal_s);
}

}  // namespace
}  // namespace motion_planning

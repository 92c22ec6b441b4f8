#include "common/lead_in.h"

#include <cmath>
#include <filesystem>
#include <numbers>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr double kToRear_m = 1.29;

void add_lane(Scenario& scenario, std::int64_t id, const std::vector<Eigen::Vector2d>& centre_m,
              const std::vector<double>& headings_rad) {
  Lanelet lanelet{.id = id};
  for (std::size_t index = 0; index < centre_m.size(); ++index) {
    const Eigen::Vector2d left = 1.75 * left_of(direction(headings_rad[index]));
    lanelet.left_m.emplace_back(centre_m[index] + left);
    lanelet.right_m.emplace_back(centre_m[index] - left);
  }
  scenario.lanelets[id] = std::move(lanelet);
}

// Along +x to the origin, then a quarter of a circle to the left.
Scenario bend(double radius_m = 20.0) {
  Scenario scenario;
  add_lane(scenario, 1, {{-40.0, 0.0}, {0.0, 0.0}}, {0.0, 0.0});
  std::vector<Eigen::Vector2d> points;
  std::vector<double> headings;
  for (int step = 0; step <= 30; ++step) {
    const double turn = std::numbers::pi / 2.0 * step / 30.0;
    points.emplace_back(radius_m * std::sin(turn), radius_m * (1.0 - std::cos(turn)));
    headings.push_back(turn);
  }
  add_lane(scenario, 2, points, headings);
  scenario.lanelets[1].successors = {2};
  scenario.lanelets[2].predecessors = {1};
  return scenario;
}

ScenarioState in_bend(double turn_rad, double slant_rad = 0.0) {
  return {.position_m = {20.0 * std::sin(turn_rad), 20.0 * (1.0 - std::cos(turn_rad))},
          .heading_rad = turn_rad + slant_rad,
          .speed_mps = 10.0};
}

TEST(LeadIn, EndIsExactlyTheInitialState) {
  const LeadIn::Pose pose = LeadIn(bend(), in_bend(1.0, 0.1), kToRear_m, 30.0).at(0.0);
  EXPECT_EQ(pose.center_m, in_bend(1.0).position_m);
  EXPECT_EQ(pose.heading_rad, 1.1);
}

TEST(LeadIn, VehicleComesAlongItsLane) {
  const LeadIn way(bend(), in_bend(1.0), kToRear_m, 40.0);
  EXPECT_NEAR(way.at(10.0).heading_rad, 0.5, 0.1);
  EXPECT_NEAR((way.at(10.0).center_m - in_bend(0.5).position_m).norm(), 0.0, 0.3);
  EXPECT_NEAR(way.at(10.0).curvature_per_m, 1.0 / 20.0, 0.02);
  EXPECT_NEAR(way.at(40.0).heading_rad, 0.0, 0.02);
  EXPECT_NEAR(way.at(40.0).center_m.y(), 0.0, 0.2);
}

TEST(LeadIn, WheelsAreStraightBeforeAnInitialStateInATightBend) {
  ScenarioState initial = in_bend(1.0);
  initial.position_m *= 0.3;
  const LeadIn way(bend(6.0), initial, kToRear_m, 10.0);
  EXPECT_NEAR(way.at(1.0).curvature_per_m, 0.0, 1e-9);
  EXPECT_NEAR(way.at(1.0).heading_rad, 1.0, 1e-9);
  EXPECT_GT(way.at(4.0).curvature_per_m, 0.1);
  EXPECT_NEAR(way.at(10.0).center_m.y(), 0.0, 1.75 - 0.5);  // On its lane.
}

TEST(LeadIn, RearAxleGoesWhereItPoints) {
  const LeadIn way(bend(), in_bend(1.0, 0.15), kToRear_m, 40.0);
  const auto rear = [&](double before_m) -> Eigen::Vector2d {
    const LeadIn::Pose pose = way.at(before_m);
    return pose.center_m - kToRear_m * direction(pose.heading_rad);
  };
  for (double before_m = 0.25; before_m < 39.0; before_m += 0.5) {
    const Eigen::Vector2d step = rear(before_m - 0.25) - rear(before_m + 0.25);
    const double aside = cross(direction(way.at(before_m).heading_rad), step) / step.norm();
    EXPECT_NEAR(aside, 0.0, 0.03) << before_m;
    EXPECT_NEAR(step.norm(), 0.5, 0.01) << before_m;
  }
}

TEST(LeadIn, BeforeTheMapTheWayIsStraight) {
  const LeadIn way(bend(), in_bend(0.1), kToRear_m, 80.0);
  EXPECT_NEAR(way.at(70.0).center_m.x(), -68.0, 0.5);
  EXPECT_NEAR(way.at(70.0).center_m.y(), 0.0, 0.2);
}

TEST(LeadIn, OnNoLaneTheWayIsStraight) {
  const ScenarioState beside{.position_m = {100.0, 0.0}, .heading_rad = 0.5, .speed_mps = 10.0};
  const LeadIn::Pose pose = LeadIn(bend(), beside, kToRear_m, 20.0).at(10.0);
  EXPECT_NEAR((pose.center_m - (beside.position_m - 10.0 * direction(0.5))).norm(), 0.0, 1e-9);
  EXPECT_EQ(pose.curvature_per_m, 0.0);
}

TEST(LeadIn, LaneInAnotherDirectionIsNotTheVehiclesOwn) {
  const LeadIn::Pose pose = LeadIn(bend(), in_bend(0.5, 1.0), kToRear_m, 20.0).at(10.0);
  EXPECT_EQ(pose.heading_rad, 1.5);
}

}  // namespace
}  // namespace ads

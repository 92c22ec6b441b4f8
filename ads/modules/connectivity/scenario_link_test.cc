#include "scenario_link.h"

#include <chrono>
#include <filesystem>

#include <gtest/gtest.h>

namespace ads {
namespace {

using std::chrono_literals::operator""s;

const fastcycle::Time kStart{1'000s};

Scenario highway() {
  return Scenario::read(std::filesystem::path(ADS_DIR) / "data/commonroad/USA_US101-23_1_T-1.xml");
}

Mission mission_of(const Scenario& scenario) {
  return ScenarioLink(scenario, {}, kStart, {.settle = 2s}).receive_mission(kStart).value();
}

TEST(ScenarioLink, InitialPoseIsRolledBackToTheStart) {
  const Scenario scenario = highway();
  const ScenarioState& initial = scenario.problem().initial;

  const mission::InitialPose pose = mission_of(scenario).initial_pose;

  const Eigen::Vector2d moved = initial.position_m - Eigen::Vector2d(pose.x_m(), pose.y_m());
  EXPECT_NEAR(moved.norm(), 2.0 * 16.8859, 0.1);
  EXPECT_NEAR(moved.dot(direction(pose.heading_rad())), 2.0 * 16.8859, 0.2);
  EXPECT_EQ(pose.header().taken_ns(), 1'000'000'000'000);
  EXPECT_EQ(pose.speed_mps(), 16.8859);
  EXPECT_EQ(pose.position_stddev_m(), 0.5);
}

TEST(ScenarioLink, GoalHasItsWindowOnTheApplicationsClock) {
  const mission::Goal goal = mission_of(highway()).goal;

  EXPECT_EQ(goal.engage_ns(), 1'002'000'000'000);
  EXPECT_EQ(goal.window_begin_ns(), 1'015'000'000'000);
  EXPECT_EQ(goal.window_end_ns(), 1'016'000'000'000);
  EXPECT_EQ(goal.rectangle().x_m(), 173.0496);
  EXPECT_EQ(goal.heading_rad().low(), -0.77835);
  EXPECT_EQ(goal.speed_mps().high(), 19.5903);
}

TEST(ScenarioLink, RoundGoalIsDescribedByASquareInsideOfIt) {
  Scenario scenario = highway();
  GoalState& goal = scenario.problems.front().goals.front();
  goal.boxes.clear();
  goal.circles = {{.center_m = {3.0, 4.0}, .radius_m = 2.0}};

  const auto rectangle = mission_of(scenario).goal.rectangle();

  EXPECT_EQ(rectangle.x_m(), 3.0);
  EXPECT_NEAR(rectangle.length_m(), 2.828, 0.001);
}

TEST(ScenarioLink, SquareLiesInsideOfAPolygon) {
  const std::vector<Eigen::Vector2d> polygon{{0, 0}, {10, 0}, {10, 4}, {0, 4}};

  const Box square = square_inside(polygon, 0.0);

  EXPECT_NEAR(square.length_m, 4.0, 0.25);
  for (const Eigen::Vector2d& corner : square.corners()) {
    EXPECT_TRUE(contains(polygon, corner));
  }
}

TEST(ScenarioLink, MissionComesOnce) {
  ScenarioLink link(highway(), {}, kStart, {});

  EXPECT_TRUE(link.receive_mission(kStart));
  EXPECT_FALSE(link.receive_mission(kStart));
}

TEST(ScenarioLink, HazardsComeAtTheirTimes) {
  connectivity::HazardPlan plan;
  for (const double time_s : {5.0, 1.0}) {
    auto& planned = *plan.add_hazards();
    planned.set_time_s(time_s);
    planned.set_duration_s(3.0);
    planned.mutable_hazard()->set_id(static_cast<std::uint64_t>(time_s));
  }
  ScenarioLink link(highway(), plan, kStart, {.settle = 2s});

  EXPECT_TRUE(link.receive_hazards(kStart + 2s).empty());
  EXPECT_EQ(link.next_due(), kStart + 3s);
  const auto first = link.receive_hazards(kStart + 3s);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].id(), 1U);
  EXPECT_EQ(first[0].valid_until_ns(), 1'006'000'000'000);
  EXPECT_EQ(link.receive_hazards(kStart + 9s).size(), 1U);
  EXPECT_FALSE(link.next_due());
}

}  // namespace
}  // namespace ads

#include "planner_state.h"

#include <algorithm>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "straight_road.h"

namespace motion_planning {
namespace {

Planner::Memory saved_and_loaded(const Planner::Memory& memory) {
  planning::PlannerState message;
  write(memory, message);
  return read(message);
}

void expect_same(const Plan& plan, const Plan& expected, double now_s) {
  EXPECT_EQ(plan.kind, expected.kind) << now_s;
  EXPECT_EQ(plan.nominal.start_s, expected.nominal.start_s) << now_s;
  EXPECT_EQ(plan.nominal.states, expected.nominal.states) << now_s;
  EXPECT_EQ(plan.minimal_risk.states, expected.minimal_risk.states) << now_s;
  EXPECT_EQ(plan.goal_s, expected.goal_s) << now_s;
  EXPECT_EQ(plan.smallest_gap_m, expected.smallest_gap_m) << now_s;
  EXPECT_EQ(plan.candidates, expected.candidates) << now_s;
  EXPECT_EQ(plan.reason, expected.reason) << now_s;
}

// A fast vehicle that is driven by somebody else at first, has to be slow for a while, and meets a
// car that stands. The planner is saved and loaded before each of `saved_at`.
void drive(const std::vector<int>& saved_at) {
  const Road road = straight_road();
  Planner planner{PlannerConfig{}};
  Planner other{PlannerConfig{}};
  Situation situation{.ego = {.speed_mps = 17.0},
                      .road = &road,
                      .objects = {car(70.0, 0.0, 0.0)},
                      .hazards = {{.x_m = 40.0, .radius_m = 8.0, .speed_mps = 8.0}}};
  for (int cycle = 0; cycle < 24; ++cycle) {
    situation.now_s = 0.1 * cycle;
    situation.is_driving = cycle >= 2;
    if (cycle == 12) {
      situation.objects.push_back(car(situation.ego.x_m + 9.0, 0.0, 0.0, 2));
    }
    if (std::find(saved_at.begin(), saved_at.end(), cycle) != saved_at.end()) {
      other = Planner{PlannerConfig{}};
      other.set_memory(saved_and_loaded(planner.memory()));
    }
    const Plan plan = planner.plan(situation);
    expect_same(other.plan(situation), plan, situation.now_s);
    situation.ego = plan.nominal.at(situation.now_s + 0.1);
    situation.ego.y_m += 0.05;  // Localization does not quite agree.
  }
}

TEST(PlannerState, PlannerKnowsAtWhichLineItHasStood) {
  EXPECT_EQ(saved_and_loaded({.stood_at_lane = 7}).stood_at_lane, 7);
  EXPECT_FALSE(saved_and_loaded({}).stood_at_lane);
}

TEST(PlannerState, APlannerThatWasSavedAndLoadedGoesOnAsTheOtherOne) {
  drive({0, 1, 2, 3, 10, 12, 13, 14, 20});
}

TEST(PlannerState, ATrajectoryThatCannotBeDrivenIsRefused) {
  planning::PlannerState message;
  message.mutable_way();

  EXPECT_THROW(read(message), std::invalid_argument);
}

}  // namespace
}  // namespace motion_planning

#include <filesystem>

#include <gtest/gtest.h>

#include "drive_case.h"

namespace motion_planning {
namespace {

ads::Scenario scene(const std::string& name) {
  return ads::Scenario::read(std::filesystem::path(FASTCYCLE_ADS_SCENES) / (name + ".xml"));
}

void expect_success(const DriveResult& result) {
  EXPECT_TRUE(result.reached) << result.goal_miss;
  EXPECT_TRUE(result.on_road);
  EXPECT_GE(result.smallest_gap_m, 0.5) << "to " << result.gap_object << " at " << result.gap_s;
  EXPECT_GE(result.acceleration_min_mps2, -6.0);
  EXPECT_LE(result.acceleration_max_mps2, 4.0);
  EXPECT_LE(result.lateral_max_mps2, 3.0);
}

// Suites named Many are long.

TEST(ManyClosedLoops, Highway) {
  const ads::Scenario scenario = scene("USA_US101-3_1_T-1");

  expect_success(drive_through(given_case(scenario), PlannerConfig{}, {.with_model = true}));
}

TEST(ManyClosedLoops, JamWithErrorsOfSensors) {
  const ads::Scenario scenario = scene("USA_US101-4_1_T-1");

  expect_success(drive_through(given_case(scenario), PlannerConfig{},
                               {.with_model = true, .noise = 1.0, .seed = 1}));
}

TEST(ManyClosedLoops, DriveOfARecordedVehicle) {
  const ads::Scenario scenario = scene("USA_US101-4_1_T-1");
  const std::vector<DriveCase> cases = recorded_cases(scenario);
  ASSERT_FALSE(cases.empty());

  expect_success(drive_through(cases.back(), PlannerConfig{}, {.with_model = true}));
}

}  // namespace
}  // namespace motion_planning

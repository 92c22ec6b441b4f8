#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/commonroad.h"
#include "modules/motion_planning/planner.h"
#include "modules/motion_planning/road.h"

namespace motion_planning {

/// A drive to test: a scenario, and the vehicle in it that the planner replaces.
struct DriveCase {
  std::string name = {};
  const ads::Scenario* scenario = nullptr;
  std::int64_t replaced = 0;    ///< The obstacle that is removed; 0 for none.
  std::int64_t first_step = 0;  ///< The step at which the drive begins.
  State initial = {};
  Goal goal = {};  ///< Times since the drive's begin.
};

/// The planning problem of the scenario's file.
DriveCase given_case(const ads::Scenario& scenario);

/// Drives of recorded vehicles: the goal is the vehicle's final position, with the intervals that
/// planning problems of the family have.
std::vector<DriveCase> recorded_cases(const ads::Scenario& scenario);

/// The road to the goal: along the lanes' centres, joined at lane changes.
Road make_road(const ads::Scenario& scenario, const State& from, const Pose& to);

enum class Foresight { kPerfect, kConstantSpeed };

struct DriveResult {
  bool reached = false;
  bool collided = false;
  bool on_road = true;
  double smallest_gap_m = 1e9;
  std::int64_t gap_object = 0;
  double gap_s = 0.0;
  double acceleration_min_mps2 = 0.0;
  double acceleration_max_mps2 = 0.0;
  double lateral_max_mps2 = 0.0;
  double jerk_max_mps3 = 0.0;
  double reached_s = 0.0;
  double goal_miss_m = 1e9;  ///< At the best step of the window.
  std::string goal_miss = {};
  double time_mean_ms = 0.0;
  double time_max_ms = 0.0;
  double tracking_max_m = 0.0;
  double recorded_gap_m = 1e9;  ///< The gap that the recorded vehicle kept.
};

struct DriveOptions {
  Foresight foresight = Foresight::kConstantSpeed;
  std::int64_t delay_steps = 1;
  bool with_model = false;  ///< Control and a vehicle with delays in the loop, not the plan itself.
  double noise = 0.0;       ///< 1: the residual errors of the ADS's sensors.
  std::uint64_t seed = 1;
  bool is_verbose = false;
};

DriveResult drive_through(const DriveCase& drive, const PlannerConfig& config,
                          const DriveOptions& options);

}  // namespace motion_planning

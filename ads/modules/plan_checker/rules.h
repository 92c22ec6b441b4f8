#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "planning/plan.pb.h"
#include "planning/plan_verdict.pb.h"
#include "prediction/prediction.pb.h"
#include "road_area.h"

namespace plan_checker {

/// The limits for plans; README.md lists the sources.
struct Limits {
  // The vehicle.
  double length_m = 4.508;
  double width_m = 1.610;
  double wheelbase_m = 2.58;
  double centre_to_rear_axle_m = 1.29;
  double steering_max_rad = 1.066;
  double steering_rate_max_radps = 0.4;
  double speed_max_mps = 60.0;
  // Physical limits: a plan that exceeds them is rejected.
  double braking_max_mps2 = 10.0;
  double acceleration_max_mps2 = 6.0;
  double jerk_max_mps3 = 45.0;
  double lateral_max_mps2 = 8.0;
  // Comfort limits: a violation is only noted.
  double comfort_braking_mps2 = 5.0;
  double comfort_acceleration_mps2 = 4.0;
  double comfort_jerk_mps3 = 10.0;
  double comfort_lateral_mps2 = 3.0;
  // Deviation of the vehicle from the plan's start.
  double start_distance_max_m = 1.5;
  double start_heading_max_rad = 0.3;
  double start_speed_max_mps = 2.5;
  // Consistency of a point with its neighbours.
  double motion_distance_max_m = 0.2;
  double motion_distance_max_share = 0.15;
  double motion_heading_max_rad = 0.05;
  double motion_acceleration_max_mps2 = 2.5;
  /// The factor on the allowed position error for what is driven later, or only after a failure:
  /// the minimal-risk trajectory.
  double motion_later_factor = 10.0;
  // Times.
  double horizon_min_s = 3.0;
  double age_max_s = 0.5;
  /// Violations planned or predicted for later are only noted: a new plan will replace this one.
  double certain_s = 2.0;
  // Road and objects.
  double over_edge_max_m = 0.8;
  double over_edge_noted_m = 0.1;
  double gap_min_m = 0.05;
  double gap_noted_m = 0.5;
  double speed_limit_excess_max_mps = 5.0;
  double speed_limit_excess_noted_mps = 1.0;
  /// A plan that collides within this time is rejected,
  double collision_certain_s = 1.5;
  /// if the trajectory that control follows without it has no collision, or one later by this time.
  double later_s = 1.0;
};

/// The vehicle's motion from localization: the centre of its box.
struct Motion {
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;
  double speed_mps = 0.0;
};

/// The inputs of a check.
struct Surroundings {
  std::int64_t now_ns = 0;
  std::optional<Motion> ego = {};  ///< At `now_ns`.
  const prediction::Predictions* predictions = nullptr;
  const RoadArea* road = nullptr;
  /// The plan that control follows after a rejection; none if there is no recent one.
  const planning::Plan* accepted = nullptr;
};

/// Checks a plan by its message alone, independently of the planner's code.
///
/// @threads  Compatible.
class Rules {
 public:
  explicit Rules(const Limits& limits) : limits_(limits) {}

  /// Sets all fields of `verdict` except `rejected_in_a_row`. @pre  `verdict` is empty.
  void check(const planning::Plan& plan, const Surroundings& around,
             planning::PlanVerdict& verdict) const;

  /// When the body first comes closer than `gap_m` to an object's most probable motion, other than
  /// from behind; after its end a trajectory stands there. Infinite if it does not.
  struct Touch {
    double time_s;   ///< Since `around.now_ns`.
    double point_s;  ///< Since the trajectory's start.
    double gap_m;
    std::uint64_t object;
    double object_mps;
  };
  [[nodiscard]] Touch first_touch(const planning::Trajectory& trajectory,
                                  const Surroundings& around, double gap_m, double until_s) const;

 private:
  /// Whether the fallback after a rejection is better than a plan that collides.
  [[nodiscard]] bool is_apart_without(const planning::Plan& plan, const Surroundings& around) const;
  /// The same for a plan that leaves the road.
  [[nodiscard]] bool is_on_road_without(const planning::Plan& plan,
                                        const Surroundings& around) const;
  /// The maximum distance of the body from the road, from now until `certain_s`.
  [[nodiscard]] double most_beyond_m(const planning::Trajectory& trajectory,
                                     const Surroundings& around) const;
  void except(planning::Rule rule, const std::string& why, planning::PlanVerdict& verdict) const;

  Limits limits_;
};

}  // namespace plan_checker

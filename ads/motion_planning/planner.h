#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "optimizer.h"
#include "problem.h"
#include "search.h"
#include "trajectory.h"

namespace motion_planning {

enum class PlanKind : std::uint8_t {
  kNominal,  ///< Within comfort's limits, or the usual ones.
  kEvasive,  ///< Beyond them, to avoid a collision.
  kNone,     ///< No way was found: `nominal` is the minimal-risk trajectory.
};

/// A circle to be careful at: not faster than `speed_mps` in it, not at all if that is 0.
struct HazardArea {
  double x_m = 0.0;
  double y_m = 0.0;
  double radius_m = 0.0;
  double speed_mps = 0.0;
};

/// What is known when a plan is made. Times are on one clock, in seconds.
struct Situation {
  double now_s = 0.0;       ///< When the plan begins to hold.
  State ego = {};           ///< At that time.
  bool is_driving = false;  ///< Whether the vehicle follows the plans.
  const Road* road = nullptr;
  const std::vector<Road>* lanes = nullptr;  ///< Ways along single lanes, to stop on.
  std::vector<TrafficObject> objects = {};   ///< Times of their ways are since `now_s`.
  std::vector<HazardArea> hazards = {};
  std::optional<Goal> goal = {};  ///< Its times are on the clock.
};

struct Plan {
  PlanKind kind = PlanKind::kNone;
  Trajectory nominal = {};
  Trajectory minimal_risk = {};
  std::optional<double> goal_s = {};  ///< When the nominal trajectory reaches the goal.
  double smallest_gap_m = 0.0;
  std::size_t candidates = 0;  ///< Places that the search looked at,
  std::size_t feasible = 0;    ///< and those of them where nothing is touched.
  std::string reason = {};     ///< Why it is not nominal, or does not reach the goal.
};

struct PlannerConfig {
  Vehicle vehicle = {};
  std::size_t beam = 150;
  double horizon_min_s = 6.0;
  double horizon_max_s = 16.0;
  /// Predictions are taken for certain this long: a collision in that time calls for evasion.
  double certain_s = 2.5;
  /// What a new plan does not change any more: until it is made, is followed, and shows. A multiple
  /// of a trajectory's step.
  double committed_s = 0.2;
};

/// Makes plans, each of them the continuation of the last.
///
/// The search finds the gaps, the optimizer makes a way of it; a second way continues the last
/// plan. The cheaper one is driven. If it touches something soon, ways beyond comfort are tried.
/// Beside it there is always a trajectory that stops.
///
/// @threads  Confined.
class Planner {
 public:
  explicit Planner(const PlannerConfig& config) : config_(config) {}

  /// @pre  `situation.road` is a road that is not empty.
  Plan plan(const Situation& situation);

 private:
  [[nodiscard]] std::vector<State> committed(const Situation& situation) const;
  [[nodiscard]] std::vector<State> expected(const State& start, double start_s, bool is_driving,
                                            std::size_t steps) const;
  [[nodiscard]] Way continued(const Problem& problem, double start_s) const;
  [[nodiscard]] Way best_way(const Problem& problem, double start_s, bool is_driving,
                             Plan& plan) const;
  [[nodiscard]] Way evade(const Problem& problem, const Way& nominal) const;
  void add_minimal_risk(const Problem& problem, const Traffic& unyielding, Plan& plan) const;

  PlannerConfig config_;
  std::optional<Way> last_;
  double last_s_ = 0.0;         // When that way starts.
  Trajectory last_trajectory_;  // With what was committed before it.
};

}  // namespace motion_planning

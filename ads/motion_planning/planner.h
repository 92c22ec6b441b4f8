#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "give_way.h"
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
  std::vector<WaitingLine> waiting_lines = {};  ///< In the order in which the road comes to them.
  std::optional<Goal> goal = {};                ///< Its times are on the clock.
};

/// A rule that a trajectory comes up against.
struct BindingRule {
  Rule rule = {};
  Pose place = {};       ///< Where it begins to hold, on the road's line.
  double ahead_m = 0.0;  ///< Along the road, from the trajectory's begin; negative behind.
  double time_s = 0.0;   ///< When it first binds, since the trajectory's start.
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
  std::vector<BindingRule> binding_rules = {};  ///< Of the nominal trajectory, by time.
};

struct PlannerConfig {
  Vehicle vehicle = {};
  std::size_t beam = 150;
  double horizon_min_s = 6.0;
  double horizon_max_s = 16.0;
  /// For a road without a limit, if neither the driver nor others were faster: the limit in towns.
  double cruise_mps = 50.0 / 3.6;
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
  /// All that the next plan depends on, besides the situation.
  struct Memory {
    std::optional<Way> last = {};
    double last_s = 0.0;                   ///< When that way starts.
    Trajectory last_trajectory = {};       ///< With what was committed before it.
    std::optional<double> begun_mps = {};  ///< Speed when the vehicle began to follow plans.
    std::optional<std::int64_t> stood_at_lane = {};  ///< At whose line the vehicle has stood.
  };

  explicit Planner(const PlannerConfig& config) : config_(config) {}

  /// @pre  `situation.road` is a road that is not empty.
  Plan plan(const Situation& situation);

  [[nodiscard]] Memory memory() const;
  /// Goes on where the one was that remembered this.
  void set_memory(Memory memory);

 private:
  [[nodiscard]] std::vector<State> committed(const Situation& situation) const;
  [[nodiscard]] std::vector<State> expected(const State& start, double start_s, bool is_driving,
                                            std::size_t steps) const;
  [[nodiscard]] double cruise_mps(const Situation& situation) const;
  [[nodiscard]] Way continued(const Problem& problem, double start_s) const;
  [[nodiscard]] Way best_way(const Problem& problem, double start_s, bool is_driving,
                             Plan& plan) const;
  [[nodiscard]] Way evade(const Problem& problem, const Way& nominal) const;
  void add_minimal_risk(const Problem& problem, const Traffic& unyielding, Plan& plan) const;

  PlannerConfig config_;
  std::optional<double> begun_mps_;  // How fast the vehicle was when it began to follow plans.
  std::optional<std::int64_t> stood_at_lane_;  // At whose line it has stood, and not passed it.
  std::optional<Way> last_;
  double last_s_ = 0.0;         // When that way starts.
  Trajectory last_trajectory_;  // With what was committed before it.
};

}  // namespace motion_planning

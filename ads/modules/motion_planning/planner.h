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
  kNominal,  ///< Within comfort limits, or the usual ones.
  kEvasive,  ///< Beyond them, to avoid a collision.
  kNone,     ///< No way was found: `nominal` is the minimal-risk trajectory.
};

/// A circle to be careful in: with at most `speed_mps`, not entered at all if that is 0.
struct HazardArea {
  double x_m = 0.0;
  double y_m = 0.0;
  double radius_m = 0.0;
  double speed_mps = 0.0;
};

/// The inputs of a plan. Times are on one clock, in seconds.
struct Situation {
  double now_s = 0.0;       ///< When the plan takes effect.
  State ego = {};           ///< At that time.
  bool is_driving = false;  ///< Whether the vehicle follows the plans.
  const Road* road = nullptr;
  const std::vector<Road>* lanes = nullptr;  ///< Ways along single lanes, for stops.
  std::vector<TrafficObject> objects = {};   ///< Times of their ways are since `now_s`.
  std::vector<HazardArea> hazards = {};
  std::vector<WaitingLine> waiting_lines = {};  ///< In the order along the road.
  /// Where the map ends along the road. Without a goal the vehicle stops there.
  std::optional<double> map_end_m = {};
  std::optional<Goal> goal = {};  ///< Its times are on the clock.
};

/// A rule that limits a trajectory.
struct BindingRule {
  Rule rule = {};
  Pose place = {};       ///< Where it begins to apply, on the road's line.
  double ahead_m = 0.0;  ///< Along the road, from the trajectory's start; negative behind.
  double time_s = 0.0;   ///< When it first applies, since the trajectory's start.
};

struct Plan {
  PlanKind kind = PlanKind::kNone;
  Trajectory nominal = {};
  Trajectory minimal_risk = {};
  std::optional<double> goal_s = {};  ///< When the nominal trajectory reaches the goal.
  double smallest_gap_m = 0.0;
  std::size_t candidates = 0;  ///< Places that the search evaluated,
  std::size_t feasible = 0;    ///< and those of them without a collision.
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
  /// Predictions count as certain for this long: a collision in that time triggers evasion.
  double certain_s = 2.5;
  /// The time in which a new plan keeps the old one: until it is computed, followed, and effective.
  /// A multiple of a trajectory's step.
  double committed_s = 0.2;
};

/// Plans trajectories, each as the continuation of the last.
///
/// The search finds the gaps, and the optimizer refines its result to a way; a second way continues
/// the last plan. The cheaper one is chosen. If it collides soon, ways beyond the comfort limits
/// are tried. In addition there is always a trajectory that stops.
///
/// @threads  Confined.
class Planner {
 public:
  /// The planner's state: all that determines the next plan besides the situation.
  struct Memory {
    std::optional<Way> last = {};
    double last_s = 0.0;                   ///< The start of that way.
    Trajectory last_trajectory = {};       ///< Including the states committed before it.
    std::optional<double> begun_mps = {};  ///< Speed when the vehicle began to follow plans.
    std::optional<std::int64_t> stood_at_lane = {};  ///< The lane of the line at which it stopped.
  };

  explicit Planner(const PlannerConfig& config) : config_(config) {}

  /// @pre  `situation.road` is not null, and not empty.
  Plan plan(const Situation& situation);

  [[nodiscard]] Memory memory() const;
  /// Restores a saved state.
  void set_memory(Memory memory);

 private:
  [[nodiscard]] std::vector<State> committed(const Situation& situation) const;
  [[nodiscard]] std::vector<State> expected(const State& start, double start_s, bool is_driving,
                                            std::size_t steps) const;
  [[nodiscard]] double cruise_mps(const Situation& situation) const;
  [[nodiscard]] Way continued(const Problem& problem, double start_s) const;
  [[nodiscard]] Way best_way(const Problem& problem, double start_s, bool is_driving,
                             Plan& plan) const;
  [[nodiscard]] bool pulls_out(const Problem& problem, double start_s) const;
  [[nodiscard]] Way kept_on_road(const Problem& problem, Way way) const;
  [[nodiscard]] Way finished(const Problem& problem, const Goal& goal, Way way,
                             double start_s) const;
  [[nodiscard]] Way evade(const Problem& problem, const Way& nominal) const;
  void add_minimal_risk(const Problem& problem, const Traffic& unyielding, Plan& plan) const;

  PlannerConfig config_;
  std::optional<double> begun_mps_;            // The vehicle's speed when it began to follow plans.
  std::optional<std::int64_t> stood_at_lane_;  // Lane of the line where it stopped, until passed.
  std::optional<Way> last_;
  double last_s_ = 0.0;         // The start of that way.
  Trajectory last_trajectory_;  // Including the states committed before it.
};

}  // namespace motion_planning

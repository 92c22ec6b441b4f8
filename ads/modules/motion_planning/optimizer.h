#pragma once

#include <cstddef>
#include <vector>

#include "motion_planning_tuning.h"
#include "problem.h"

namespace motion_planning {

/// Optimizes a way locally: iterative LQR with Gauss-Newton costs and limits as penalties (Tassa,
/// Mansard, Todorov, "Control-limited differential dynamic programming", ICRA 2014; for driving:
/// Chen, Zhan, Tomizuka, "Constrained iterative LQR for on-road autonomous driving motion
/// planning", IEEE T-IV 4(2), 2019).
///
/// @threads  Confined.
class Optimizer {
 public:
  /// The maximum number of iterations, each linear in the number of steps.
  static constexpr int kIterationsMax = kOptimizer.iterations_max;

  explicit Optimizer(const Problem& problem) : problem_(problem), profile_(profile_of(problem)) {}

  /// The feasible way that follows `guess` most closely, with one pose for each step after the
  /// start.
  [[nodiscard]] Way follow(const std::vector<Pose>& guess);
  /// The locally best way near `guess`. It begins at the problem's start and has as many steps as
  /// `guess`.
  [[nodiscard]] Way improve(const Way& guess);
  /// The cost of a way.
  [[nodiscard]] double cost(const Way& way);

 private:
  struct Quadratic;
  struct Gains;

  [[nodiscard]] Way roll_out(const std::vector<Input>& inputs) const;
  Way descend(Way way, int iterations_max);
  double total_cost(const Way& way);
  void aim(const Way& way);
  void add_stage(Quadratic& sum, std::size_t step, const State& state, const Input* input) const;
  void add_motion(Quadratic& sum, const State& state, const Input* input) const;
  void add_road(Quadratic& sum, std::size_t step, const State& state) const;
  void add_speed(Quadratic& sum, std::size_t step, const State& state,
                 const RoadPlace& place) const;
  void add_edges(Quadratic& sum, const State& state, const RoadPlace& place) const;
  void add_traffic(Quadratic& sum, std::size_t step, const State& state) const;
  void add_goal(Quadratic& sum, std::size_t step, const State& state) const;
  void add_pursuit(Quadratic& sum, const Pose& pose, const State& state) const;

  const Problem& problem_;
  const SpeedProfile profile_;

  // Fixed during an iteration.
  const std::vector<Pose>* pursued_ = nullptr;
  std::vector<std::size_t> road_hints_;
  std::vector<double> lanes_m_;
  std::size_t goal_step_ = 0;  // 0: none.
  double goal_extra_s_ = 0.0;  // The goal's time after that of its step.
};

}  // namespace motion_planning

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "problem.h"

namespace motion_planning {

/// The result of a search.
struct Found {
  std::vector<Pose> poses = {};  ///< One for each step after the start.
  double cost = 0.0;
  bool reaches_goal = false;
  std::size_t candidates = 0;  ///< Number of evaluated positions.
  std::size_t feasible = 0;    ///< Those of them without a collision.
};

/// Finds the gaps: a beam search over time, position along the road, offset and speed, coarse but
/// for the whole time up to the goal and over all lanes (a state lattice in time as in Ziegler and
/// Stiller, "Spatiotemporal state lattices for fast trajectory planning in dynamic on-road driving
/// scenarios", IROS 2009, in the road's frame as in Werling et al., "Optimal trajectory generation
/// for dynamic street scenarios in a Frenet frame", ICRA 2010).
///
/// One layer is two steps of `Traffic` long. Of the states of a layer that share a cell, the
/// cheapest is kept; of the cells, the `beam` most promising ones.
///
/// @threads  Confined.
class Search {
 public:
  Search(const Problem& problem, std::size_t beam);

  [[nodiscard]] Found run();

 private:
  // A box in the road's frame.
  struct Block {
    double along_m = 0.0;
    double half_length_m = 0.0;
    double offset_m = 0.0;
    double half_width_m = 0.0;
    std::array<Occupant::Space, 3> spaces = {};
  };
  struct Node {
    double along_m = 0.0;
    double speed_mps = 0.0;
    double acceleration_mps2 = 0.0;
    int offset = 0;  // In units of `kOffset_m` from the start's.
    int move = 0;    // Change of the offset, in the last layer.
    double cost = 0.0;
    double goal_cost = 0.0;  // The smallest miss of the goal so far.
    double promise = 0.0;    // Cost, including an estimate of the remaining cost.
    std::int32_t parent = -1;
    std::uint32_t cell = 0;
  };

  void place_traffic();
  void expand(std::size_t layer, const Node& from, std::int32_t index);
  void keep(const Node& node);
  [[nodiscard]] double allowed(const Node& from, double acceleration_mps2, double end_s) const;
  [[nodiscard]] double traffic_cost(std::size_t step, double along_m, double offset_m,
                                    bool& is_hit) const;
  [[nodiscard]] double goal_offset_m(double along_m) const;
  [[nodiscard]] double goal_miss(const Node& from, const Node& to, double from_s) const;
  [[nodiscard]] double still_to_come(const Node& node, double time_s) const;
  [[nodiscard]] double road_cost(const Node& node) const;

  const Problem& problem_;
  const SpeedProfile profile_;
  const double braking_mps2_;  // Applies above the speed that the profile permits.
  const std::size_t beam_;
  std::size_t layers_ = 0;
  RoadPlace start_;
  RoadPlace goal_;
  std::vector<std::vector<Block>> blocks_;  // By step.
  std::vector<Node> nodes_;                 // All that were kept, layer by layer.
  std::vector<Node> next_;                  // The layer under construction.
  std::vector<std::int32_t> cells_;         // Index into `next_`, by hash of the cell.
  std::size_t candidates_ = 0;
  std::size_t feasible_ = 0;
};

}  // namespace motion_planning

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "lane_graph.h"

namespace ads {

struct RouteOptions {
  /// What a change of lane costs, in metres of way, where there is room for it.
  double lane_change_m = 30.0;
  /// How much road a change of lane takes; on less it costs more in proportion.
  double change_length_m = 60.0;
  /// Start and goal may lie so far beside the lanes,
  double beside_m = 3.0;
  /// and so far before the map's first lanes and behind its last ones.
  double beyond_m = 150.0;
  /// How far to go where no place is asked for.
  double anywhere_m = 1000.0;
};

/// Where to go: to a place, else onto one of the lanes, else anywhere.
struct RouteGoal {
  std::optional<Eigen::Vector2d> place_m = {};
  std::optional<double> heading_rad = {};
  std::vector<std::int64_t> lanes = {};
};

/// A way along lanes.
struct LanePath {
  struct Step {
    std::int64_t lane = 0;
    bool is_change = false;  ///< It is reached from the step before by a change of lane.
  };
  std::vector<Step> steps = {};  ///< One at least.
  double start_along_m = 0.0;    ///< On the first lane; below 0 before the map.
  double goal_along_m = 0.0;     ///< On the last one; above its length behind the map.
  std::vector<std::int64_t> goal_lanes = {};
};

/// The shortest way from a place to a goal, or why there is none. Dijkstra's algorithm ("A note on
/// two problems in connexion with graphs", 1959) over the lanes: an edge to each successor costs
/// what remains of the lane, one to the lane beside costs `lane_change_m`.
std::variant<LanePath, std::string> find_path(const LaneGraph& graph,
                                              const Eigen::Vector2d& start_m, double heading_rad,
                                              const RouteGoal& goal, const RouteOptions& options);

/// The one of `lanes` that needs the smallest turn after, or before, `lane`.
std::optional<std::int64_t> straight_on(const LaneGraph& graph, std::int64_t lane);
std::optional<std::int64_t> straight_back(const LaneGraph& graph, std::int64_t lane);

}  // namespace ads

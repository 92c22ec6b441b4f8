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
  /// The cost of a lane change with sufficient length, in metres of way.
  double lane_change_m = 30.0;
  /// The length that a lane change needs; a shorter one costs more in proportion.
  double change_length_m = 60.0;
  /// The maximum distance of start and goal from the lanes sideways,
  double beside_m = 3.0;
  /// and before the map's first lanes or after its last ones.
  double beyond_m = 150.0;
  /// The length of a route without a given place.
  double anywhere_m = 1000.0;
};

/// The goal: a place, else one of the lanes, else anywhere.
struct RouteGoal {
  std::optional<Eigen::Vector2d> place_m = {};
  std::optional<double> heading_rad = {};
  std::vector<std::int64_t> lanes = {};
};

/// A route along lanes.
struct LanePath {
  struct Step {
    std::int64_t lane = 0;
    bool is_change = false;  ///< It is reached from the previous step by a lane change.
  };
  std::vector<Step> steps = {};  ///< At least one.
  double start_along_m = 0.0;    ///< On the first lane; below 0 before the map.
  double goal_along_m = 0.0;     ///< On the last one; above its length beyond the map.
  std::vector<std::int64_t> goal_lanes = {};
};

/// The shortest route from a position to a goal, or why there is none. Dijkstra's algorithm ("A
/// note on two problems in connexion with graphs", 1959) over the lanes: an edge to each successor
/// costs the remaining length of the lane, one to an adjacent lane costs `lane_change_m`.
std::variant<LanePath, std::string> find_path(const LaneGraph& graph,
                                              const Eigen::Vector2d& start_m, double heading_rad,
                                              const RouteGoal& goal, const RouteOptions& options);

/// The successor, or the predecessor, of `lane` with the smallest change of direction.
std::optional<std::int64_t> straight_on(const LaneGraph& graph, std::int64_t lane);
std::optional<std::int64_t> straight_back(const LaneGraph& graph, std::int64_t lane);

}  // namespace ads

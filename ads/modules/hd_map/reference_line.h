#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "lane_graph.h"
#include "router.h"

namespace ads {

struct ReferenceOptions {
  double change_length_m = 60.0;  ///< The length of a transition to another lane.
  double extension_m = 60.0;      ///< Its extension beyond start and goal.
  /// The largest standard deviation of the weights that smooth it,
  double smoothing_m = 20.0;
  /// and how far this may shift it.
  double smoothing_error_m = 0.3;
  double step_m = 1.0;  ///< Between its points, at most.
};

/// A line along a path, and the road beside it.
struct ReferenceLine {
  std::vector<Eigen::Vector2d> points_m = {};
  /// At each point, distances to the edges of the lanes of that direction.
  std::vector<double> left_edge_m = {};
  std::vector<double> right_edge_m = {};
  std::vector<double> speed_limit_mps = {};
};

/// Follows the lanes' centres; changes to an adjacent lane by a quintic blend of both; continues
/// along the map before the start and after the goal, and straight beyond the map's end. Points are
/// then averaged with Gaussian weights, as wide as the permitted shift allows, which smooths the
/// corners of the map's lines; in a curve of radius R weights of deviation s shift the line inwards
/// by s²/2R.
ReferenceLine reference_line(const LaneGraph& graph, const LanePath& path,
                             const ReferenceOptions& options);

}  // namespace ads

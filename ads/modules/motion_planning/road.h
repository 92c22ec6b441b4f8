#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "motion_planning_tuning.h"

namespace motion_planning {

/// One point of the planning reference line, from a map.
struct RoadPoint {
  double x_m = 0.0;
  double y_m = 0.0;
  double left_edge_m = 0.0;      ///< Distance to the road's left edge.
  double right_edge_m = 0.0;     ///< Distance to the right edge.
  double speed_limit_mps = 0.0;  ///< 0 where there is none.
};

/// A position relative to a road: along its line, and to the left of it.
struct RoadPlace {
  double along_m = 0.0;
  double offset_m = 0.0;
  double heading_rad = 0.0;  ///< Of the line there.
  std::size_t index = 0;     ///< Of the preceding point of the road: a hint for the next search.
};

/// A position and heading in the map.
struct Pose {
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;
};

/// A line with a road around it, resampled to equal steps, and extended straight at both ends.
///
/// @threads  Compatible.
class Road {
 public:
  static constexpr double kStep_m = kRoad.step_m;
  /// The maximum number of points: the rest of a longer road is cut off.
  static constexpr std::size_t kPointsMax = kRoad.points_max;

  Road() = default;
  explicit Road(const std::vector<RoadPoint>& points);

  /// Adds a lane's centre line, in driving direction. Parts that lie beside the road, or lead
  /// elsewhere, are ignored.
  void add_lane(const std::vector<Eigen::Vector2d>& centre_m);

  [[nodiscard]] bool is_empty() const { return points_.size() < 2; }
  [[nodiscard]] double length_m() const {
    return kStep_m * static_cast<double>(points_.empty() ? 0 : points_.size() - 1);
  }

  /// The nearest position on the whole road.
  ///
  /// @realtime Grows with the square root of the road's length.
  [[nodiscard]] RoadPlace locate(double x_m, double y_m) const;
  /// The nearest position within some steps of `hint`, the index of a nearby one.
  [[nodiscard]] RoadPlace locate_near(double x_m, double y_m, std::size_t hint) const;
  [[nodiscard]] Pose pose(double along_m, double offset_m) const;

  [[nodiscard]] double left_edge_m(double along_m) const;
  [[nodiscard]] double right_edge_m(double along_m) const;
  /// 0 where there is none.
  [[nodiscard]] double speed_limit_mps(double along_m) const;
  [[nodiscard]] double curvature_per_m(double along_m) const;
  /// The centre of the lane nearest to `offset_m`; `offset_m` itself where no lane is known.
  [[nodiscard]] double lane_m(double along_m, double offset_m) const;

 private:
  struct Point {
    RoadPoint at = {};
    double heading_rad = 0.0;  // Of the way to the next point; not wrapped.
    double cosine = 1.0;       // Of the heading.
    double sine = 0.0;
    double curvature_per_m = 0.0;
    std::vector<double> lanes_m = {};  // Offsets of the lanes' centres, left positive.
  };

  // Consecutive points, all within `radius_m` of one of them.
  struct Block {
    std::size_t first = 0;
    std::size_t last = 0;  // After the block.
    double x_m = 0.0;
    double y_m = 0.0;
    double radius_m = 0.0;
  };

  void make_blocks();
  [[nodiscard]] std::size_t nearest_point(double x_m, double y_m) const;
  [[nodiscard]] std::size_t index_at(double along_m) const;
  [[nodiscard]] RoadPlace place_on(std::size_t index, double x_m, double y_m) const;

  std::vector<Point> points_;
  std::vector<Block> blocks_;  // A spatial index: most of the road is too far away to be searched.
};

/// The angle wrapped into (-pi, pi].
double wrapped(double angle_rad);

}  // namespace motion_planning

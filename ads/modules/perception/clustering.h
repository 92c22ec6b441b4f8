#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace ads {

struct ClusteringConfig {
  double range_max_m = 80.0;
  /// Returns closer than this are connected. Along the line of sight the returns of one beam are
  /// farther apart, increasingly with distance: up to `along_max_m`.
  double across_m = 0.45;
  double along_max_m = 1.6;
};

/// Groups points that are close to each other: connected components of the occupied cells of a grid
/// around the sensor.
///
/// Two occupied cells are joined if one lies in an ellipse around the other, which is longer along
/// the line of sight: there a surface seen at a grazing angle gives few returns.
///
/// @threads  Confined.
/// @realtime Allocates only while the number of points grows.
class Clustering {
 public:
  explicit Clustering(const ClusteringConfig& config);

  /// For each point, the index of its group, in the order of their first points; -1 for a point out
  /// of range.
  ///
  /// @param points_m  Relative to the sensor, in axes common to all points.
  /// @param spread    Distance of neighbouring beams, per metre of range.
  const std::vector<int>& group(std::span<const Eigen::Vector2f> points_m, double spread);

  [[nodiscard]] int groups() const { return groups_; }

 private:
  struct Cell {
    int column;
    int row;
    int root;
  };

  [[nodiscard]] int cell_at(float x_m, float y_m);
  void join_neighbours(int cell, double spread);
  int root_of(int cell);

  const ClusteringConfig config_;
  const int side_;
  std::vector<int> grid_;  // The index of a cell in `cells_`, or -1.
  std::vector<Cell> cells_;
  std::vector<int> group_of_;
  std::vector<int> number_;
  int groups_ = 0;
};

}  // namespace ads

#include "clustering.h"

#include <algorithm>
#include <cmath>

#include "common/scalar.h"
#include "perception_tuning.h"

namespace ads {
namespace {}  // namespace

Clustering::Clustering(const ClusteringConfig& config)
    : config_(config),
      side_(2 * static_cast<int>(std::ceil(config.range_max_m / kClustering.cell_m)) + 1),
      grid_(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_), -1) {}

const std::vector<int>& Clustering::group(std::span<const Eigen::Vector2f> points_m,
                                          double spread) {
  for (const Cell& cell : cells_) {
    grid_[static_cast<std::size_t>(cell.row * side_ + cell.column)] = -1;
  }
  cells_.clear();
  group_of_.clear();
  for (const Eigen::Vector2f& point : points_m) {
    group_of_.push_back(cell_at(point.x(), point.y()));
  }
  for (int cell = 0; cell < static_cast<int>(cells_.size()); ++cell) {
    join_neighbours(cell, spread);
  }
  number_.assign(cells_.size(), -1);
  groups_ = 0;
  for (int& group : group_of_) {
    if (group >= 0) {
      int& number = number_[static_cast<std::size_t>(root_of(group))];
      number = number < 0 ? groups_++ : number;
      group = number;
    }
  }
  return group_of_;
}

int Clustering::cell_at(float x_m, float y_m) {
  const int column = side_ / 2 + static_cast<int>(std::lround(x_m / kClustering.cell_m));
  const int row = side_ / 2 + static_cast<int>(std::lround(y_m / kClustering.cell_m));
  if (column < 0 || column >= side_ || row < 0 || row >= side_) {
    return -1;
  }
  int& cell = grid_[static_cast<std::size_t>(row * side_ + column)];
  if (cell < 0) {
    cell = static_cast<int>(cells_.size());
    cells_.push_back({.column = column, .row = row, .root = cell});
  }
  return cell;
}

void Clustering::join_neighbours(int cell, double spread) {
  const Cell here = cells_[static_cast<std::size_t>(cell)];
  const double x = kClustering.cell_m * (here.column - side_ / 2);
  const double y = kClustering.cell_m * (here.row - side_ / 2);
  const double range = std::max(kClustering.cell_m, std::hypot(x, y));
  const double across = std::max(config_.across_m, 2.0 * spread * range);
  const double along =
      std::clamp(1.5 * spread * squared(range) / kClustering.aside_m, across, config_.along_max_m);
  const int reach = static_cast<int>(std::max(across, along) / kClustering.cell_m);
  // Half of the neighbours: the others look back at this cell.
  for (int up = 0; up <= reach; ++up) {
    for (int right = up == 0 ? 1 : -reach; right <= reach; ++right) {
      const int column = here.column + right;
      const int row = here.row + up;
      if (column < 0 || column >= side_ || row >= side_) {
        continue;
      }
      const int other = grid_[static_cast<std::size_t>(row * side_ + column)];
      const double ahead = kClustering.cell_m * (right * x + up * y) / range;
      const double aside = kClustering.cell_m * (up * x - right * y) / range;
      if (other >= 0 && squared(ahead / along) + squared(aside / across) <= 1.0) {
        cells_[static_cast<std::size_t>(root_of(other))].root = root_of(cell);
      }
    }
  }
}

int Clustering::root_of(int cell) {
  auto* at = &cells_[static_cast<std::size_t>(cell)];
  while (at->root != cell) {
    auto& above = cells_[static_cast<std::size_t>(at->root)];
    at->root = above.root;
    cell = at->root;
    at = &cells_[static_cast<std::size_t>(cell)];
  }
  return cell;
}

}  // namespace ads

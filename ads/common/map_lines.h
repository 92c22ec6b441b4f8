#pragma once

#include <algorithm>
#include <vector>

#include <Eigen/Core>

#include "hd_map/map.pb.h"

namespace ads {

/// The points of a line of the map, in metres.
inline std::vector<Eigen::Vector2d> points_of(const hd_map::Line& line) {
  std::vector<Eigen::Vector2d> points;
  for (int index = 0; index < std::min(line.x_m_size(), line.y_m_size()); ++index) {
    points.emplace_back(line.x_m(index), line.y_m(index));
  }
  return points;
}

}  // namespace ads

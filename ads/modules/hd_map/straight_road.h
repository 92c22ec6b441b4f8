#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "lane_graph.h"

namespace ads {

/// Lanes of a straight road along x for tests: rows of `lanes` lanes of 3.5 m, each row `length_m`
/// long. Lane 1 is the right one of the first row, lane 11 that of the second, and so on; y is 0 in
/// the middle of the right lane.
inline std::vector<MapLane> straight_road(int rows, int lanes, double length_m = 100.0) {
  std::vector<MapLane> road;
  for (int row = 0; row < rows; ++row) {
    for (int lane = 0; lane < lanes; ++lane) {
      const std::int64_t id = 10 * row + lane + 1;
      const double y = 3.5 * lane;
      const double begin = row * length_m;
      MapLane one{.id = id,
                  .left_m = {{begin, y + 1.75}, {begin + length_m, y + 1.75}},
                  .right_m = {{begin, y - 1.75}, {begin + length_m, y - 1.75}},
                  .speed_limit_mps = 20.0};
      if (row > 0) {
        one.predecessors = {id - 10};
      }
      if (row + 1 < rows) {
        one.successors = {id + 10};
      }
      if (lane > 0) {
        one.right = LaneBeside{.id = id - 1, .is_same_direction = true};
      }
      if (lane + 1 < lanes) {
        one.left = LaneBeside{.id = id + 1, .is_same_direction = true};
      }
      road.push_back(std::move(one));
    }
  }
  return road;
}

}  // namespace ads

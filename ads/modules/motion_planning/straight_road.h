#pragma once

#include <vector>

#include "road.h"
#include "traffic.h"

// A road for tests: straight along x from -50 m to 400 m, with three lanes of 3.5 m whose middle
// one is the line y = 0.

namespace motion_planning {

constexpr double kLane_m = 3.5;

inline Road straight_road(double speed_limit_mps = 0.0) {
  std::vector<RoadPoint> points;
  for (double x = -50.0; x <= 400.0; x += 5.0) {
    points.push_back({.x_m = x,
                      .y_m = 0.0,
                      .left_edge_m = 1.5 * kLane_m,
                      .right_edge_m = 1.5 * kLane_m,
                      .speed_limit_mps = speed_limit_mps});
  }
  Road road(points);
  for (const double offset : {-kLane_m, 0.0, kLane_m}) {
    road.add_lane({{-50.0, offset}, {400.0, offset}});
  }
  return road;
}

/// A car that is at (x, y) at time 0 and continues along the road at its speed.
inline TrafficObject car(double x_m, double y_m, double speed_mps, std::uint64_t id = 1) {
  return {.id = id,
          .length_m = 4.5,
          .width_m = 1.8,
          .ways = {{.states = {{.x_m = x_m, .y_m = y_m, .speed_mps = speed_mps}}}}};
}

}  // namespace motion_planning

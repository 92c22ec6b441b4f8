#pragma once

#include <cmath>
#include <cstdint>

#include "hd_map/map.pb.h"

namespace ads::testing {

inline void add_point(hd_map::Line& line, double x_m, double y_m) {
  line.add_x_m(x_m);
  line.add_y_m(y_m);
}

/// A lane of 3.5 m between two places, straight along x or y.
inline hd_map::Lane& add_lane(hd_map::Tile& tile, std::int64_t id, double from_x_m, double from_y_m,
                              double to_x_m, double to_y_m) {
  hd_map::Lane& lane = *tile.add_lanes();
  lane.set_id(id);
  const double length_m = std::hypot(to_x_m - from_x_m, to_y_m - from_y_m);
  const double side_x = -1.75 * (to_y_m - from_y_m) / length_m;
  const double side_y = 1.75 * (to_x_m - from_x_m) / length_m;
  add_point(*lane.mutable_left(), from_x_m + side_x, from_y_m + side_y);
  add_point(*lane.mutable_left(), to_x_m + side_x, to_y_m + side_y);
  add_point(*lane.mutable_right(), from_x_m - side_x, from_y_m - side_y);
  add_point(*lane.mutable_right(), to_x_m - side_x, to_y_m - side_y);
  return lane;
}

/// A road along x: right lane 1 then 11 at y = 0, left lane 2 then 12 at y = 3.5, of the other
/// direction 3 at y = 7. Lane 5 crosses 11 at x = 150, coming from the right.
inline hd_map::Tile small_map() {
  hd_map::Tile tile;
  for (const int row : {0, 1}) {
    for (const int side : {0, 1}) {
      hd_map::Lane& lane = add_lane(tile, 10 * row + side + 1, 100.0 * row, 3.5 * side,
                                    100.0 * row + 100.0, 3.5 * side);
      if (row == 0) {
        lane.add_successors(10 + side + 1);
      } else {
        lane.add_predecessors(side + 1);
      }
      if (side == 0) {
        lane.set_left_lane(10 * row + 2);
        lane.set_is_left_same_direction(true);
      } else {
        lane.set_right_lane(10 * row + 1);
        lane.set_is_right_same_direction(true);
        lane.set_left_lane(3);
      }
      if (row == 1) {
        lane.add_conflicts(5);
        lane.add_yields_to(5);
      }
    }
  }
  add_lane(tile, 3, 200.0, 7.0, 0.0, 7.0);
  hd_map::Lane& crossing = add_lane(tile, 5, 150.0, -60.0, 150.0, 60.0);
  crossing.add_conflicts(11);
  crossing.add_conflicts(12);
  return tile;
}

/// Along lanes 1 and 11.
inline hd_map::Route small_route() {
  hd_map::Route route;
  route.set_is_found(true);
  for (int x = 0; x <= 200; ++x) {
    add_point(*route.mutable_reference(), x, 0.0);
    route.add_left_edge_m(5.25);
    route.add_right_edge_m(1.75);
  }
  for (const int row : {0, 10}) {
    auto& section = *route.add_sections();
    section.add_lanes(row + 1);
    section.add_lanes(row + 2);
    section.add_continuing(row + 1);
  }
  return route;
}

}  // namespace ads::testing

#pragma once

#include <cstdint>

#include "hd_map/map.pb.h"

namespace ads::testing {

/// A road along x: lanes 1 then 11 at y = 0, lanes 2 then 12 at y = 3.5; 21 branches off 1 and
/// turns to the right.
inline hd_map::Tile small_map() {
  hd_map::Tile tile;
  const auto add_point = [](hd_map::Lane& lane, double x_m, double y_m, double side_x_m,
                            double side_y_m) {
    lane.mutable_left()->add_x_m(x_m + side_x_m);
    lane.mutable_left()->add_y_m(y_m + side_y_m);
    lane.mutable_right()->add_x_m(x_m - side_x_m);
    lane.mutable_right()->add_y_m(y_m - side_y_m);
  };
  for (const int row : {0, 1}) {
    for (const int side : {0, 1}) {
      hd_map::Lane& lane = *tile.add_lanes();
      lane.set_id(10 * row + side + 1);
      add_point(lane, 200.0 * row, 3.5 * side, 0.0, 1.75);
      add_point(lane, 200.0 * row + 200.0, 3.5 * side, 0.0, 1.75);
      if (row == 0) {
        lane.add_successors(11 + side);
      }
      if (side == 0) {
        lane.set_left_lane(10 * row + 2);
        lane.set_is_left_same_direction(true);
      } else {
        lane.set_right_lane(10 * row + 1);
        lane.set_is_right_same_direction(true);
      }
    }
  }
  tile.mutable_lanes(0)->add_successors(21);
  hd_map::Lane& turn = *tile.add_lanes();
  turn.set_id(21);
  add_point(turn, 200.0, 0.0, 0.0, 1.75);
  add_point(turn, 210.0, -4.0, 1.3, 1.3);
  add_point(turn, 214.0, -14.0, 1.75, 0.0);
  return tile;
}

}  // namespace ads::testing

#pragma once

#include <string_view>
#include <vector>

#include "common/geodesy.h"
#include "lane_graph.h"

namespace ads {

/// The lanes of a map in some local plane.
struct GeoreferencedLanes {
  std::vector<MapLane> lanes = {};
  /// Where on Earth the plane's (0, 0) is: x is east and y is north there.
  GeodeticPosition origin = {};
};

/// The lanes of a Lanelet2 map: OSM XML 0.6 with relations of `type=lanelet` (F. Poggenhans et al.,
/// "Lanelet2: A high-definition map framework for the future of automated driving", ITSC 2018).
///
/// The lane of a lanelet has its id; that of its other direction, where it is driven both ways, has
/// the negative one. Latitude and longitude become places in the tangential plane (`LocalFrame`) in
/// the middle of the lanelets' nodes, their heights aside.
///
/// @errors  Throws `std::runtime_error` with `name`, line, what was expected and what was found.
GeoreferencedLanes lanelet2_lanes(std::string_view text, std::string_view name,
                                  const MapLimits& limits = {});

}  // namespace ads

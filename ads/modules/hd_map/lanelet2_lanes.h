#pragma once

#include <string_view>
#include <vector>

#include "common/geodesy.h"
#include "lane_graph.h"

namespace ads {

/// The lanes of a map in some local plane.
struct GeoreferencedLanes {
  std::vector<MapLane> lanes = {};
  /// The position on Earth of the plane's (0, 0); x is east and y is north there.
  GeodeticPosition origin = {};
};

/// The lanes of a Lanelet2 map: OSM XML 0.6 with relations of `type=lanelet` (F. Poggenhans et al.,
/// "Lanelet2: A high-definition map framework for the future of automated driving", ITSC 2018).
///
/// The lane of a lanelet has its id; the lane in the opposite direction of a two-way lanelet has
/// the negative one. Latitude and longitude are converted to positions in the tangential plane
/// (`LocalFrame`) at the middle of the lanelets' nodes; heights are ignored.
///
/// @errors  Throws `std::runtime_error` with `name`, line, what was expected and what was found.
GeoreferencedLanes lanelet2_lanes(std::string_view text, std::string_view name,
                                  const MapLimits& limits = {});

}  // namespace ads

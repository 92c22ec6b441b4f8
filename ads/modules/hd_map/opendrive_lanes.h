#pragma once

#include <string_view>
#include <vector>

#include "lane_graph.h"

namespace ads {

/// The lanes of an OpenDRIVE map, version 1.x (ASAM OpenDRIVE 1.8.1 describes the format), in the
/// plane of the file: one for each lane of each lane section, numbered in the order of the file.
///
/// Bounds are sampled each metre, and where a geometry or a width begins. Heights are ignored.
///
/// @errors  Throws `std::runtime_error` with `name`, line, what was expected and what was found.
std::vector<MapLane> opendrive_lanes(std::string_view text, std::string_view name,
                                     const MapLimits& limits = {});

}  // namespace ads

#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "common/geodesy.h"
#include "lane_graph.h"

namespace ads {

/// The lanes of a map file of any format that is known.
struct MapFile {
  LaneGraph graph;
  /// Where on Earth the map's (0, 0) is, if the file says it; x is east and y is north there.
  std::optional<GeodeticPosition> origin = {};
};

/// Reads a map: CommonRoad, Lanelet2 or OpenDRIVE, as its root element says.
///
/// @errors  Throws `std::runtime_error` with file, place, what was expected and what was found.
MapFile read_map(const std::filesystem::path& file);
/// Reads the `text` of a file; `name` stands in the messages of what is thrown.
MapFile parse_map(std::string_view text, std::string_view name, const MapLimits& limits = {});

}  // namespace ads

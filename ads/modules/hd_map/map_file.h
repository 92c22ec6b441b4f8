#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "common/geodesy.h"
#include "lane_graph.h"

namespace ads {

/// The lanes of a map file of any supported format.
struct MapFile {
  LaneGraph graph;
  /// The position on Earth of the map's (0, 0), if the file has it; x is east and y north there.
  std::optional<GeodeticPosition> origin = {};
};

/// Reads a map: CommonRoad, Lanelet2 or OpenDRIVE, by its root element.
///
/// @errors  Throws `std::runtime_error` with file, place, what was expected and what was found.
MapFile read_map(const std::filesystem::path& file);
/// Reads the `text` of a file; `name` is used in error messages.
MapFile parse_map(std::string_view text, std::string_view name, const MapLimits& limits = {});

}  // namespace ads

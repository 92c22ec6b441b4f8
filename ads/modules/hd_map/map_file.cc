#include "map_file.h"

#include <cstddef>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "common/commonroad.h"
#include "common/files.h"
#include "commonroad_lanes.h"
#include "lanelet2_lanes.h"
#include "opendrive_lanes.h"

namespace ads {
namespace {

// Maps of cities have less; as elements it takes up to a gigabyte.
constexpr std::uintmax_t kLargestFile = std::uintmax_t{64} << 20U;

// The name of the first element, behind declarations and comments.
std::string_view root_name(std::string_view text) {
  constexpr std::string_view kComment = "<!--";
  std::size_t begin = text.find('<');
  while (begin != std::string_view::npos) {
    const std::string_view rest = text.substr(begin);
    const bool is_comment = rest.starts_with(kComment);
    if (!is_comment && !rest.starts_with("<?") && !rest.starts_with("<!")) {
      return rest.substr(1, rest.find_first_of(" \t\r\n/>", 1) - 1);
    }
    const std::size_t end = text.find(is_comment ? "-->" : ">", begin);
    begin = end == std::string_view::npos ? end : text.find('<', end);
  }
  return {};
}

LaneGraph graph_of(std::vector<MapLane> lanes, std::string_view name, const MapLimits& limits) {
  try {
    return LaneGraph(std::move(lanes), limits);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", name, error.what()));
  }
}

}  // namespace

MapFile parse_map(std::string_view text, std::string_view name, const MapLimits& limits) {
  const std::string_view root = root_name(text);
  if (root == "osm") {
    GeoreferencedLanes map = lanelet2_lanes(text, name, limits);
    return {.graph = graph_of(std::move(map.lanes), name, limits), .origin = map.origin};
  }
  if (root == "OpenDRIVE") {
    return {.graph = graph_of(opendrive_lanes(text, name, limits), name, limits)};
  }
  if (root == "commonRoad") {
    return {.graph = graph_of(lanes_of(Scenario::parse(text, name)), name, limits)};
  }
  throw std::runtime_error(fmt::format(
      "{}:1: expected <commonRoad>, <osm> or <OpenDRIVE>, found '{}'", name, root.substr(0, 40)));
}

MapFile read_map(const std::filesystem::path& file) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (!error && size > kLargestFile) {
    throw std::runtime_error(fmt::format("{}: expected a map of at most {} bytes, found {}",
                                         file.string(), kLargestFile, size));
  }
  return parse_map(read_file(file), file.string());
}

}  // namespace ads

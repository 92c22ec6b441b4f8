// Reads any bytes as a map, and drives over it. What is not reported by a `std::runtime_error` that
// names the file is a bug of ours.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <variant>

#include "fastcycle/assert.h"
#include "map_file.h"
#include "reference_line.h"
#include "router.h"

namespace {

// Small, so that a fuzzer finds what lies beyond them.
constexpr ads::MapLimits kLimits{.lanes = 200,
                                 .lanes_length_m = 20'000.0,
                                 .roads_length_m = 5'000.0,
                                 .points = 20'000,
                                 .work = 500'000,
                                 .work_per_lane = 1'000};

std::optional<ads::MapFile> read(std::string_view text) {
  try {
    return ads::parse_map(text, "map", kLimits);
  } catch (const std::runtime_error& error) {
    FASTCYCLE_ASSERT(std::string_view(error.what()).starts_with("map:"), "the file is named");
    return {};
  }
}

void drive(const ads::LaneGraph& graph) {
  const auto& first = graph.nodes().begin()->second.center;
  const auto& last = graph.nodes().rbegin()->second.center;
  const auto found = ads::find_path(graph, first.point_at(0.0), first.heading_at(0.0),
                                    {.place_m = last.point_at(last.length_m())}, {});
  if (const auto* path = std::get_if<ads::LanePath>(&found)) {
    const ads::ReferenceLine line = ads::reference_line(graph, *path, {});
    FASTCYCLE_ASSERT(line.points_m.size() == line.left_edge_m.size(), "each point has its edges");
  }
  (void)graph.within(first.point_at(0.0), 100.0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto map = read(text)) {
    drive(map->graph);
  }
  return 0;
}

// Routes between random places of a map, as JSON: what check_routes.py holds against the file.
//
//   hd_map_routes MAP [--pairs N] [--seed N]

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <map>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "map_file.h"
#include "reference_line.h"
#include "router.h"

namespace ads {
namespace {

using Json = nlohmann::json;

double ms_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

Json json_of(const Eigen::Vector2d& point) {
  return {point.x(), point.y()};
}

Json json_of(const LaneGraph::Node& node) {
  const MapLane& lane = node.lane;
  return {{"name", lane.name},
          {"is_drivable", node.is_drivable()},
          {"length_m", node.center.length_m()},
          {"left", {json_of(lane.left_m.front()), json_of(lane.left_m.back())}},
          {"right", {json_of(lane.right_m.front()), json_of(lane.right_m.back())}}};
}

class Places {
 public:
  Places(const LaneGraph& graph, std::uint64_t seed) : graph_(graph), random_(seed) {
    for (const auto& [id, node] : graph.nodes()) {
      if (node.is_drivable()) {
        lanes_.push_back(id);
      }
    }
    if (lanes_.empty()) {
      throw std::runtime_error("expected a lane to drive on, found none");
    }
  }

  struct Place {
    std::int64_t lane = 0;
    Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
    double heading_rad = 0.0;
  };

  Place draw() {
    const std::int64_t lane = lanes_[random_() % lanes_.size()];
    const Polyline& center = graph_.node(lane).center;
    const double part = static_cast<double>(random_() % 1001U) / 1000.0;
    const double along_m = (0.02 + 0.96 * part) * center.length_m();
    return {.lane = lane,
            .position_m = center.point_at(along_m),
            .heading_rad = center.heading_at(along_m)};
  }

 private:
  const LaneGraph& graph_;
  std::mt19937_64 random_;
  std::vector<std::int64_t> lanes_;
};

Json json_of(const Places::Place& place) {
  return {{"lane", place.lane}, {"position_m", json_of(place.position_m)}};
}

Json route(const LaneGraph& graph, Places& places) {
  const Places::Place start = places.draw();
  const Places::Place goal = places.draw();
  const auto begin = std::chrono::steady_clock::now();
  const auto found =
      find_path(graph, start.position_m, start.heading_rad,
                {.place_m = goal.position_m, .heading_rad = goal.heading_rad}, RouteOptions{});
  Json json{{"start", json_of(start)}, {"goal", json_of(goal)}, {"search_ms", ms_since(begin)}};
  if (const auto* reason = std::get_if<std::string>(&found)) {
    json["reason"] = *reason;
    return json;
  }
  const auto& path = std::get<LanePath>(found);
  for (const LanePath::Step& step : path.steps) {
    json["steps"].push_back({{"lane", step.lane}, {"is_change", step.is_change}});
  }
  json["reference_points"] = reference_line(graph, path, {}).points_m.size();
  json["total_ms"] = ms_since(begin);
  return json;
}

int run(std::span<char*> arguments) {
  std::map<std::string_view, std::uint64_t> options{{"--pairs", 100}, {"--seed", 1}};
  if (arguments.size() < 2 || arguments.size() % 2 != 0) {
    throw std::runtime_error("expected hd_map_routes MAP [--pairs N] [--seed N]");
  }
  for (std::size_t index = 2; index + 1 < arguments.size(); index += 2) {
    if (!options.contains(arguments[index])) {
      throw std::runtime_error(
          fmt::format("expected --pairs or --seed, found '{}'", arguments[index]));
    }
    options[arguments[index]] = std::stoull(arguments[index + 1]);
  }
  const auto begin = std::chrono::steady_clock::now();
  const MapFile map = read_map(arguments[1]);
  Json json{{"load_ms", ms_since(begin)}};
  if (map.origin) {
    json["origin_deg"] = {map.origin->latitude_deg, map.origin->longitude_deg};
  }
  for (const auto& [id, node] : map.graph.nodes()) {
    json["lanes"][std::to_string(id)] = json_of(node);
  }
  Places places(map.graph, options["--seed"]);
  json["routes"] = Json::array();
  for (std::uint64_t pair = 0; pair < options["--pairs"]; ++pair) {
    json["routes"].push_back(route(map.graph, places));
  }
  fmt::print("{}\n", json.dump());
  return 0;
}

}  // namespace
}  // namespace ads

int main(int argc, char** argv) {
  try {
    return ads::run({argv, static_cast<std::size_t>(argc)});
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}

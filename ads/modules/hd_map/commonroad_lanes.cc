#include "commonroad_lanes.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <string_view>
#include <utility>

#include "words.h"

namespace ads {
namespace {

constexpr std::array<std::string_view, 4> kYieldSigns{"205", "206", "R1-1", "R1-2"};
constexpr std::array<std::string_view, 2> kStopSigns{"206", "R1-1"};
constexpr std::array<std::string_view, 2> kPrioritySigns{"301", "306"};

LaneKind kind_of(const Lanelet& lanelet) {
  static const std::map<std::string_view, LaneKind> kKinds{
      {"urban", LaneKind::kRoad},        {"country", LaneKind::kRoad},
      {"driveWay", LaneKind::kRoad},     {"mainCarriageWay", LaneKind::kRoad},
      {"intersection", LaneKind::kRoad}, {"unknown", LaneKind::kRoad},
      {"highway", LaneKind::kHighway},   {"interstate", LaneKind::kHighway},
      {"accessRamp", LaneKind::kRamp},   {"exitRamp", LaneKind::kRamp},
      {"shoulder", LaneKind::kShoulder}, {"crosswalk", LaneKind::kCrossing},
      {"sidewalk", LaneKind::kOther},    {"bicycleLane", LaneKind::kOther},
      {"busLane", LaneKind::kOther},     {"busStop", LaneKind::kOther},
      {"parking", LaneKind::kOther},     {"restrictedArea", LaneKind::kOther},
      {"border", LaneKind::kOther},
  };
  // Of several types the most specific one: they are in the order of the enumeration.
  LaneKind kind = LaneKind::kRoad;
  for (const std::string& type : lanelet.types) {
    const auto found = kKinds.find(type);
    kind = std::max(kind, found == kKinds.end() ? LaneKind::kRoad : found->second);
  }
  return kind;
}

std::vector<std::int64_t> signs_of(const Lanelet& lanelet) {
  std::vector<std::int64_t> signs = lanelet.signs;
  if (lanelet.stop_line) {
    signs.insert(signs.end(), lanelet.stop_line->signs.begin(), lanelet.stop_line->signs.end());
  }
  return signs;
}

bool has_stop_sign(const Lanelet& lanelet, const Scenario& scenario) {
  return std::ranges::any_of(signs_of(lanelet), [&](std::int64_t id) {
    return std::ranges::any_of(
        scenario.signs.at(id).elements,
        [](const TrafficSign::Element& element) { return is_one_of(kStopSigns, element.sign); });
  });
}

int priority_of(const Lanelet& lanelet, const Scenario& scenario) {
  int priority = 0;
  for (const std::int64_t id : signs_of(lanelet)) {
    for (const TrafficSign::Element& element : scenario.signs.at(id).elements) {
      if (is_one_of(kYieldSigns, element.sign)) {
        return -1;
      }
      if (is_one_of(kPrioritySigns, element.sign)) {
        priority = 1;
      }
    }
  }
  return priority;
}

bool has_light(const Lanelet& lanelet) {
  return !lanelet.lights.empty() || (lanelet.stop_line && !lanelet.stop_line->lights.empty());
}

std::optional<LaneBeside> beside(const std::optional<Neighbour>& neighbour) {
  return neighbour ? std::optional<LaneBeside>(
                         {.id = neighbour->id, .is_same_direction = neighbour->is_same_direction})
                   : std::nullopt;
}

// A stop sign without a line is at the lane's end.
MapLane lane_of(const Lanelet& lanelet, const Scenario& scenario) {
  MapLane lane{.id = lanelet.id,
               .kind = kind_of(lanelet),
               .left_m = lanelet.left_m,
               .right_m = lanelet.right_m,
               .predecessors = lanelet.predecessors,
               .successors = lanelet.successors,
               .left = beside(lanelet.left),
               .right = beside(lanelet.right),
               .speed_limit_mps = lanelet.speed_limit_mps.value_or(0.0),
               .has_stop_sign = has_stop_sign(lanelet, scenario)};
  if (lanelet.stop_line || lane.has_stop_sign) {
    const std::array<Eigen::Vector2d, 2> end{lanelet.left_m.back(), lanelet.right_m.back()};
    lane.stop_line = lanelet.stop_line ? lanelet.stop_line->ends_m.value_or(end) : end;
  }
  return lane;
}

// The lanes through an intersection that begin at one way in.
std::vector<std::int64_t> lanes_through(const Intersection::Incoming& incoming,
                                        const Scenario& scenario) {
  std::vector<std::int64_t> lanes;
  for (const auto& turn : {incoming.right, incoming.straight, incoming.left}) {
    lanes.insert(lanes.end(), turn.begin(), turn.end());
  }
  if (lanes.empty()) {
    for (const std::int64_t id : incoming.lanelets) {
      const auto& next = scenario.lanelets.at(id).successors;
      lanes.insert(lanes.end(), next.begin(), next.end());
    }
  }
  return lanes;
}

void add_intersection(const Intersection& intersection, const Scenario& scenario,
                      std::map<std::int64_t, MapLane>& lanes) {
  bool has_lights = false;
  std::map<std::int64_t, std::vector<std::int64_t>> through;
  for (const Intersection::Incoming& incoming : intersection.incomings) {
    int priority = 0;
    for (const std::int64_t id : incoming.lanelets) {
      const Lanelet& lanelet = scenario.lanelets.at(id);
      has_lights |= has_light(lanelet);
      const int own = priority_of(lanelet, scenario);
      priority = own != 0 ? own : priority;
    }
    through[incoming.id] = lanes_through(incoming, scenario);
    for (const std::int64_t id : through[incoming.id]) {
      lanes.at(id).is_in_intersection = true;
      const int own = priority_of(scenario.lanelets.at(id), scenario);
      lanes.at(id).priority = own != 0 ? own : priority;
    }
  }
  for (const Intersection::Incoming& incoming : intersection.incomings) {
    // To whose left it is, that one comes from the right.
    if (has_lights || !incoming.left_of || !through.contains(*incoming.left_of)) {
      continue;
    }
    for (const std::int64_t id : through[incoming.id]) {
      auto& from_right = lanes.at(id).from_right;
      const auto& right = through[*incoming.left_of];
      from_right.insert(from_right.end(), right.begin(), right.end());
    }
  }
}

}  // namespace

std::vector<MapLane> lanes_of(const Scenario& scenario) {
  std::map<std::int64_t, MapLane> lanes;
  for (const auto& [id, lanelet] : scenario.lanelets) {
    lanes.emplace(id, lane_of(lanelet, scenario));
  }
  // Where lanes join outside of an intersection, their signs determine which one waits.
  for (auto& [id, lane] : lanes) {
    lane.priority = priority_of(scenario.lanelets.at(id), scenario);
  }
  for (const Intersection& intersection : scenario.intersections) {
    add_intersection(intersection, scenario, lanes);
  }
  std::vector<MapLane> list;
  for (auto& [id, lane] : lanes) {
    list.push_back(std::move(lane));
  }
  return list;
}

}  // namespace ads

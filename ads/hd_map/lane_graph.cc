#include "lane_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace ads {
namespace {

// A lane that changes its direction by more is a turn.
constexpr double kTurn_rad = 0.6;
// Who comes from farther round than this comes from ahead.
constexpr double kOncoming_rad = 2.2;
// Ends of lanes touch those of others; what lies between counts.
constexpr double kEnds_m = 1.0;
constexpr double kStep_m = 0.5;

bool has(const std::vector<std::int64_t>& ids, std::int64_t id) {
  return std::ranges::find(ids, id) != ids.end();
}

bool share(const std::vector<std::int64_t>& a, const std::vector<std::int64_t>& b) {
  return std::ranges::any_of(a, [&](std::int64_t id) { return has(b, id); });
}

double turn_rad(const Polyline& line) {
  return normalize_angle(line.heading_at(line.length_m()) - line.heading_at(0.0));
}

// Whether the line, without its ends, runs through the lane for more than a touch.
bool runs_through(const Polyline& line, const LaneGraph::Node& lane) {
  int inside = 0;
  for (double along = kEnds_m; along < line.length_m() - kEnds_m; along += kStep_m) {
    inside = lane.contains(line.point_at(along)) ? inside + 1 : 0;
    if (inside == 2) {
      return true;
    }
  }
  return false;
}

double distance_from_line_m(const Polyline& line, const Eigen::Vector2d& point_m) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t index = 0; index + 1 < line.points_m().size(); ++index) {
    least =
        std::min(least, distance_m(point_m, line.points_m()[index], line.points_m()[index + 1]));
  }
  return least;
}

LaneGraph::Node node_of(MapLane lane) {
  if (lane.left_m.size() != lane.right_m.size()) {
    throw std::runtime_error(
        fmt::format("lane {}: expected as many points on the left as on the right, found {} and {}",
                    lane.id, lane.left_m.size(), lane.right_m.size()));
  }
  std::vector<Eigen::Vector2d> center;
  Eigen::AlignedBox2d bounds;
  for (std::size_t index = 0; index < lane.left_m.size(); ++index) {
    center.emplace_back((lane.left_m[index] + lane.right_m[index]) / 2.0);
    bounds.extend(lane.left_m[index]);
    bounds.extend(lane.right_m[index]);
  }
  try {
    Polyline middle(center);
    Polyline left(lane.left_m);
    Polyline right(lane.right_m);
    return {.lane = std::move(lane),
            .center = std::move(middle),
            .left = std::move(left),
            .right = std::move(right),
            .bounds = bounds};
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(fmt::format("lane {}: {}", lane.id, error.what()));
  }
}

}  // namespace

bool LaneGraph::Node::contains(const Eigen::Vector2d& point_m) const {
  if (!bounds.contains(point_m)) {
    return false;
  }
  std::vector<Eigen::Vector2d> polygon = lane.right_m;
  polygon.insert(polygon.end(), lane.left_m.rbegin(), lane.left_m.rend());
  return ads::contains(polygon, point_m);
}

double LaneGraph::Node::distance_m(const Eigen::Vector2d& point_m, double beyond_m) const {
  if (contains(point_m)) {
    return 0.0;
  }
  const double from_bounds_m =
      std::min(distance_from_line_m(left, point_m), distance_from_line_m(right, point_m));
  const Polyline::Projection place = center.project(point_m);
  const bool is_before = place.along_m < 0.0 && lane.predecessors.empty();
  const bool is_after = place.along_m > center.length_m() && lane.successors.empty();
  if (!is_before && !is_after) {
    return from_bounds_m;
  }
  const std::size_t end = is_before ? 0 : lane.left_m.size() - 1;
  const double half_m = (lane.left_m[end] - lane.right_m[end]).norm() / 2.0;
  const double beyond = is_before ? -place.along_m : place.along_m - center.length_m();
  return std::min(from_bounds_m, std::hypot(std::max(0.0, std::abs(place.offset_m) - half_m),
                                            std::max(0.0, beyond - beyond_m)));
}

bool LaneGraph::Node::is_drivable() const {
  return lane.kind == LaneKind::kRoad || lane.kind == LaneKind::kHighway ||
         lane.kind == LaneKind::kRamp;
}

LaneGraph::LaneGraph(std::vector<MapLane> lanes) {
  for (MapLane& lane : lanes) {
    const std::int64_t id = lane.id;
    if (!nodes_.emplace(id, node_of(std::move(lane))).second) {
      throw std::runtime_error(fmt::format("lane {}: expected once, found twice", id));
    }
  }
  check_references();
  find_conflicts();
}

std::vector<std::int64_t> LaneGraph::beside(std::int64_t id) const {
  const auto next = [&](std::int64_t from, bool is_left) -> std::optional<std::int64_t> {
    const auto& side = is_left ? node(from).lane.left : node(from).lane.right;
    const bool is_lane = side && side->is_same_direction && node(side->id).is_drivable();
    return is_lane ? std::optional(side->id) : std::nullopt;
  };
  std::vector<std::int64_t> lanes{id};
  while (const auto right = next(lanes.back(), false)) {
    if (has(lanes, *right)) {
      break;  // A map in which lanes lie side by side in a ring.
    }
    lanes.push_back(*right);
  }
  std::ranges::reverse(lanes);
  while (const auto left = next(lanes.back(), true)) {
    if (has(lanes, *left)) {
      break;
    }
    lanes.push_back(*left);
  }
  return lanes;
}

std::vector<std::int64_t> LaneGraph::within(const Eigen::Vector2d& place_m, double radius_m) const {
  std::vector<std::int64_t> found;
  for (const auto& [id, node] : nodes_) {
    if (node.bounds.exteriorDistance(place_m) <= radius_m &&
        node.distance_m(place_m, 0.0) <= radius_m) {
      found.push_back(id);
    }
  }
  return found;
}

void LaneGraph::check_references() const {
  const auto check = [this](std::int64_t from, std::int64_t id, std::string_view what) {
    if (!nodes_.contains(id)) {
      throw std::runtime_error(fmt::format("lane {}: its {} {} is not in the map", from, what, id));
    }
  };
  for (const auto& [id, node] : nodes_) {
    for (const std::int64_t other : node.lane.predecessors) {
      check(id, other, "predecessor");
    }
    for (const std::int64_t other : node.lane.successors) {
      check(id, other, "successor");
    }
    for (const auto& side : {node.lane.left, node.lane.right}) {
      if (side) {
        check(id, side->id, "neighbour");
      }
    }
  }
}

void LaneGraph::find_conflicts() {
  for (auto a = nodes_.begin(); a != nodes_.end(); ++a) {
    for (auto b = std::next(a); b != nodes_.end(); ++b) {
      if (!is_conflict(a->second, b->second)) {
        continue;
      }
      a->second.conflicts.push_back(b->first);
      b->second.conflicts.push_back(a->first);
      if (yields(a->second, b->second)) {
        a->second.yields_to.push_back(b->first);
      } else if (yields(b->second, a->second)) {
        b->second.yields_to.push_back(a->first);
      }
    }
  }
}

bool LaneGraph::is_conflict(const Node& a, const Node& b) const {
  if (a.lane.kind == LaneKind::kOther || b.lane.kind == LaneKind::kOther ||
      has(a.lane.successors, b.lane.id) || has(b.lane.successors, a.lane.id) ||
      has(beside(a.lane.id), b.lane.id)) {
    return false;
  }
  if (share(a.lane.successors, b.lane.successors)) {
    return true;
  }
  const auto is_beside = [](const std::optional<LaneBeside>& side, const Node& other) {
    return side && side->id == other.lane.id;
  };
  if (!a.bounds.intersects(b.bounds) || share(a.lane.predecessors, b.lane.predecessors) ||
      is_beside(a.lane.left, b) || is_beside(a.lane.right, b) || is_beside(b.lane.left, a) ||
      is_beside(b.lane.right, a)) {
    return false;
  }
  return runs_through(a.center, b) || runs_through(b.center, a);
}

bool LaneGraph::yields(const Node& a, const Node& b) {
  const auto ranks = [](bool of_a, bool of_b) { return of_a != of_b; };
  const bool a_walks = a.lane.kind == LaneKind::kCrossing;
  const bool b_walks = b.lane.kind == LaneKind::kCrossing;
  if (ranks(a_walks, b_walks)) {
    return b_walks;
  }
  if (a.lane.priority != b.lane.priority) {
    return a.lane.priority < b.lane.priority;
  }
  const bool a_joins = a.lane.kind == LaneKind::kRamp;
  const bool b_joins = b.lane.kind == LaneKind::kRamp;
  if (ranks(a_joins, b_joins) && share(a.lane.successors, b.lane.successors)) {
    return a_joins;
  }
  const bool a_turns = turn_rad(a.center) > kTurn_rad;
  const bool b_turns = turn_rad(b.center) > kTurn_rad;
  const double between =
      std::abs(normalize_angle(a.center.heading_at(0.0) - b.center.heading_at(0.0)));
  if (ranks(a_turns, b_turns) && between > kOncoming_rad) {
    return a_turns;
  }
  return a.lane.priority <= 0 && has(a.lane.from_right, b.lane.id);
}

}  // namespace ads

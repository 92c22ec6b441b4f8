#include "lane_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "hd_map_tuning.h"

namespace ads {
namespace {

bool has(const std::vector<std::int64_t>& ids, std::int64_t id) {
  return std::ranges::find(ids, id) != ids.end();
}

bool share(const std::vector<std::int64_t>& a, const std::vector<std::int64_t>& b) {
  return std::ranges::any_of(a, [&](std::int64_t id) { return has(b, id); });
}

double turn_rad(const Polyline& line) {
  return normalize_angle(line.heading_at(line.length_m()) - line.heading_at(0.0));
}

// Whether the line, without its ends, runs through the lane for more than a touch. Counts its work.
bool runs_through(const Polyline& line, const LaneGraph::Node& lane, std::int64_t work_max,
                  std::int64_t& work) {
  int inside = 0;
  for (double along = kLaneGraph.ends_m; along < line.length_m() - kLaneGraph.ends_m;
       along += kLaneGraph.step_m) {
    const Eigen::Vector2d point = line.point_at(along);
    const bool is_near = lane.bounds.contains(point);
    inside = is_near && lane.contains(point) ? inside + 1 : 0;
    work += is_near ? std::ssize(lane.lane.left_m) : 1;
    if (inside == 2) {
      return true;
    }
    if (work > work_max) {
      return false;
    }
  }
  return false;
}

bool is_beside(const std::optional<LaneBeside>& side, const LaneGraph::Node& other) {
  return side && side->id == other.lane.id;
}

// Whether it is the same lane, driven the other way.
bool is_reverse(const MapLane& a, const MapLane& b) {
  return a.left_m.front() == b.right_m.back() && a.left_m.back() == b.right_m.front() &&
         a.right_m.front() == b.left_m.back() && a.right_m.back() == b.left_m.front();
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

LaneGraph::LaneGraph(std::vector<MapLane> lanes, const MapLimits& limits) {
  if (lanes.size() > limits.lanes) {
    throw std::runtime_error(
        fmt::format("expected at most {} lanes, found {}", limits.lanes, lanes.size()));
  }
  double length_m = 0.0;
  for (MapLane& lane : lanes) {
    const std::int64_t id = lane.id;
    const auto [place, is_new] = nodes_.emplace(id, node_of(std::move(lane)));
    if (!is_new) {
      throw std::runtime_error(fmt::format("lane {}: expected once, found twice", id));
    }
    length_m += place->second.center.length_m();
    if (!(length_m <= limits.lanes_length_m)) {
      throw std::runtime_error(fmt::format("lane {}: expected at most {:g} m of lanes, found {:g}",
                                           id, limits.lanes_length_m, length_m));
    }
  }
  check_references();
  keeps_left_ = keeps_left();
  find_conflicts(limits.work + limits.work_per_lane * std::ssize(nodes_));
}

std::vector<std::int64_t> LaneGraph::beside(std::int64_t id) const {
  const auto next = [&](std::int64_t from, bool is_left) -> std::optional<std::int64_t> {
    const auto& side = is_left ? node(from).lane.left : node(from).lane.right;
    const bool is_lane = side && side->may_change() && node(side->id).is_drivable();
    return is_lane ? std::optional(side->id) : std::nullopt;
  };
  std::vector<std::int64_t> lanes{id};
  const auto add_all = [&](bool is_left) {
    for (std::size_t count = 0; count < kLaneGraph.beside_max; ++count) {
      const auto side = next(lanes.back(), is_left);
      if (!side || has(lanes, *side)) {  // In a ring, in a map that makes no sense.
        return;
      }
      lanes.push_back(*side);
    }
  };
  add_all(false);
  std::ranges::reverse(lanes);
  add_all(true);
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
  const auto count = [](const MapLane& lane, std::size_t links, std::string_view what) {
    if (links > kLinksMax) {
      throw std::runtime_error(fmt::format("lane {}: expected at most {} {}, found {}", lane.id,
                                           kLinksMax, what, links));
    }
  };
  const auto check = [this](std::int64_t from, std::int64_t id, std::string_view what) {
    if (!nodes_.contains(id)) {
      throw std::runtime_error(fmt::format("lane {}: its {} {} is not in the map", from, what, id));
    }
  };
  for (const auto& [id, node] : nodes_) {
    count(node.lane, node.lane.predecessors.size(), "predecessors");
    count(node.lane, node.lane.successors.size(), "successors");
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

// Determines for each two lanes with overlapping bounds whether they conflict, in a sweep from west
// to east.
void LaneGraph::find_conflicts(std::int64_t work_max) {
  std::vector<Node*> lanes;
  for (auto& [id, node] : nodes_) {
    if (node.lane.kind != LaneKind::kOther) {
      lanes.push_back(&node);
    }
  }
  std::ranges::sort(
      lanes, {}, [](const Node* node) { return std::pair(node->bounds.min().x(), node->lane.id); });
  std::int64_t work = 0;
  for (auto first = lanes.begin(); first != lanes.end(); ++first) {
    for (auto second = std::next(first);
         second != lanes.end() &&
         (*second)->bounds.min().x() <= (*first)->bounds.max().x() + kLaneGraph.touch_m;
         ++second) {
      const auto [a, b] = std::minmax(*first, *second, [](const Node* one, const Node* other) {
        return one->lane.id < other->lane.id;
      });
      if (is_conflict(*a, *b, work_max, work)) {
        add_conflict(*a, *b);
      }
      if (++work > work_max) {
        throw std::runtime_error(fmt::format(
            "lane {}: expected {} lanes to lie upon each other in fewer places, found it after {} "
            "points",
            a->lane.id, nodes_.size(), work));
      }
    }
  }
  for (auto& [id, node] : nodes_) {
    std::ranges::sort(node.conflicts);
    std::ranges::sort(node.yields_to);
  }
}

bool LaneGraph::keeps_left() const {
  const auto is_opposite = [](const std::optional<LaneBeside>& side) {
    return side && !side->is_same_direction;
  };
  double on_left_m = 0.0;
  double on_right_m = 0.0;
  for (const auto& [id, node] : nodes_) {
    if (node.is_drivable()) {
      on_left_m += is_opposite(node.lane.left) ? node.center.length_m() : 0.0;
      on_right_m += is_opposite(node.lane.right) ? node.center.length_m() : 0.0;
    }
  }
  // Maps have single lanes with the wrong neighbour.
  return on_right_m > 3.0 * on_left_m;
}

void LaneGraph::add_conflict(Node& a, Node& b) const {
  a.conflicts.push_back(b.lane.id);
  b.conflicts.push_back(a.lane.id);
  if (yields(a, b)) {
    a.yields_to.push_back(b.lane.id);
  } else if (yields(b, a)) {
    b.yields_to.push_back(a.lane.id);
  }
}

bool LaneGraph::is_conflict(const Node& a, const Node& b, std::int64_t work_max,
                            std::int64_t& work) const {
  const auto touches = [](const Node& one, const Node& other) {
    return one.bounds.exteriorDistance(other.bounds) <= kLaneGraph.touch_m;
  };
  if (!touches(a, b)) {
    return false;
  }
  work += 100;
  if (has(a.lane.successors, b.lane.id) || has(b.lane.successors, a.lane.id) ||
      has(beside(a.lane.id), b.lane.id) || is_reverse(a.lane, b.lane)) {
    return false;
  }
  if (share(a.lane.successors, b.lane.successors)) {
    return true;
  }
  if (!a.bounds.intersects(b.bounds) || share(a.lane.predecessors, b.lane.predecessors) ||
      is_beside(a.lane.left, b) || is_beside(a.lane.right, b) || is_beside(b.lane.left, a) ||
      is_beside(b.lane.right, a)) {
    return false;
  }
  return runs_through(a.center, b, work_max, work) || runs_through(b.center, a, work_max, work);
}

bool LaneGraph::yields(const Node& a, const Node& b) const {
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
  const double across = keeps_left_ ? -1.0 : 1.0;
  const bool a_turns = across * turn_rad(a.center) > kLaneGraph.turn_rad;
  const bool b_turns = across * turn_rad(b.center) > kLaneGraph.turn_rad;
  const double between =
      std::abs(normalize_angle(a.center.heading_at(0.0) - b.center.heading_at(0.0)));
  if (ranks(a_turns, b_turns) && between > kLaneGraph.oncoming_rad) {
    return a_turns;
  }
  return a.lane.priority <= 0 && has(a.lane.from_right, b.lane.id);
}

}  // namespace ads

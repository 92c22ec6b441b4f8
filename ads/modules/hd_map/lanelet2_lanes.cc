#include "lanelet2_lanes.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "common/plane.h"
#include "common/xml.h"
#include "hd_map_tuning.h"
#include "osm_file.h"
#include "words.h"

namespace ads {
namespace {

bool is_yes(std::string_view value) {
  return value == "yes" || value == "true" || value == "1";
}

// The directions in which a line may be crossed, seen along it.
struct Crossing {
  bool to_left = true;
  bool to_right = true;
};

Crossing crossing_of(const Tags& tags) {
  constexpr std::array<std::string_view, 2> kLines{"line_thin", "line_thick"};
  Crossing crossing{.to_left = false, .to_right = false};
  if (is_one_of(kLines, tag_of(tags, "type"))) {
    const std::string_view subtype = tag_of(tags, "subtype");
    crossing.to_left = subtype == "dashed" || subtype == "solid_dashed";
    crossing.to_right = subtype == "dashed" || subtype == "dashed_solid";
  }
  const auto take = [&](std::string_view key, bool& is_allowed) {
    const std::string_view value = tag_of(tags, key);
    is_allowed = value.empty() ? is_allowed : is_yes(value);
  };
  take("lane_change", crossing.to_left);
  take("lane_change", crossing.to_right);
  take("lane_change:left", crossing.to_left);
  take("lane_change:right", crossing.to_right);
  return crossing;
}

// One side of a lanelet: the nodes of its ways, one after the other.
struct Bound {
  std::vector<std::int64_t> nodes = {};
  Crossing crossing = {};

  void reverse() {
    std::ranges::reverse(nodes);
    std::swap(crossing.to_left, crossing.to_right);
  }
};

// Appends the nodes of a way that begins or ends where the bound does.
void append(std::vector<std::int64_t> nodes, Crossing crossing, bool is_second, Bound& bound,
            const XmlElement& element) {
  const auto joins = [&] {
    return bound.nodes.back() == nodes.front() || bound.nodes.back() == nodes.back();
  };
  if (is_second && !joins()) {
    bound.reverse();
  }
  if (!joins()) {
    element.fail(fmt::format("a way that begins or ends at node {}, as the one before it does",
                             bound.nodes.back()),
                 fmt::format("one from node {} to node {}", nodes.front(), nodes.back()));
  }
  if (bound.nodes.back() != nodes.front()) {
    std::ranges::reverse(nodes);
    std::swap(crossing.to_left, crossing.to_right);
  }
  bound.nodes.insert(bound.nodes.end(), std::next(nodes.begin()), nodes.end());
  bound.crossing.to_left &= crossing.to_left;
  bound.crossing.to_right &= crossing.to_right;
}

Bound read_bound(const OsmFile& osm, const OsmRelation& lanelet, std::string_view role,
                 std::size_t points_max, std::size_t& points) {
  Bound bound;
  int ways = 0;
  for (const OsmRelation::Member& member : lanelet.members) {
    if (member.role != role || member.type != "way") {
      continue;
    }
    const OsmWay& way = osm.way(member.id, member.element);
    if (way.nodes.empty()) {
      way.element.fail("<nd> in the <way> of a lanelet", "none");
    }
    points += way.nodes.size();
    if (points > points_max) {
      member.element.fail(fmt::format("at most {} nodes of all lanelets' ways", points_max),
                          "more");
    }
    const Crossing crossing = crossing_of(tags_of(way.element));
    if (ways == 0) {
      bound = {.nodes = way.nodes, .crossing = crossing};
    } else {
      append(way.nodes, crossing, ways == 1, bound, member.element);
    }
    ++ways;
  }
  if (ways == 0) {
    lanelet.element.fail(fmt::format("a way with role {} of a lanelet", role), "none");
  }
  return bound;
}

// A speed as "50", "50 km/h", "30 mph", or "13.9 m/s".
std::optional<double> speed_mps(std::string_view text) {
  double value = 0.0;
  const auto [after, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const std::string_view unit =
      trimmed({after, static_cast<std::size_t>(text.data() + text.size() - after)});
  if (error != std::errc() || !(value > 0.0 && value < 1000.0)) {
    return std::nullopt;
  }
  if (unit.empty() || unit == "km/h" || unit == "kmh" || unit == "kph") {
    return value / 3.6;
  }
  if (unit == "mph") {
    return value * 0.44704;
  }
  return unit == "m/s" || unit == "mps" ? std::optional(value) : std::nullopt;
}

// The limit of a German speed limit sign: "de274-60"; "de274_1" begins a zone of 30 km/h.
std::optional<double> speed_of_sign_mps(std::string_view sign) {
  if (!sign.starts_with("de274")) {
    return std::nullopt;
  }
  const std::size_t dash = sign.find('-');
  if (dash != std::string_view::npos) {
    return speed_mps(sign.substr(dash + 1));
  }
  return sign.size() > 5 ? speed_mps("30") : std::nullopt;
}

// Without a sign, as § 3 of Germany's road traffic regulations has it for cars.
double usual_speed_mps(const Tags& tags) {
  if (tag_of(tags, "region") != "de" || tag_of(tags, "subtype") != "road") {
    return 0.0;
  }
  return tag_of(tags, "location") == "urban"      ? 50.0 / 3.6
         : tag_of(tags, "location") == "nonurban" ? 100.0 / 3.6
                                                  : 0.0;
}

double speed_limit_mps(const OsmRelation& lanelet) {
  const std::string_view text = tag_of(lanelet.tags, "speed_limit");
  if (text.empty()) {
    return usual_speed_mps(lanelet.tags);
  }
  if (text == "none") {
    return 0.0;
  }
  const auto speed = speed_mps(text);
  if (!speed) {
    lanelet.element.fail("a speed_limit such as '50 km/h'", XmlElement::quoted(text));
  }
  return *speed;
}

// Whether cars may drive there: given by the participants, if any, else by the subtype.
bool is_for_cars(const Tags& tags) {
  constexpr std::array<std::string_view, 4> kForCars{"road", "highway", "play_street", "exit"};
  constexpr std::string_view kParticipant = "participant:";
  const auto said = tags.lower_bound(kParticipant);
  if (said == tags.end() || !said->first.starts_with(kParticipant)) {
    return is_one_of(kForCars, tag_of(tags, "subtype"));
  }
  const std::string_view car = tag_of(tags, "participant:vehicle:car");
  return is_yes(car.empty() ? tag_of(tags, "participant:vehicle") : car);
}

LaneKind kind_of(const Tags& tags) {
  const std::string_view subtype = tag_of(tags, "subtype");
  if (subtype == "crosswalk") {
    return LaneKind::kCrossing;
  }
  if (is_for_cars(tags)) {
    return subtype == "highway" ? LaneKind::kHighway : LaneKind::kRoad;
  }
  return subtype == "emergency_lane" ? LaneKind::kShoulder : LaneKind::kOther;
}

bool is_drivable(LaneKind kind) {
  return kind == LaneKind::kRoad || kind == LaneKind::kHighway;
}

bool is_two_way(const Tags& tags) {
  const std::string_view vehicle = tag_of(tags, "one_way:vehicle");
  const std::string_view value = vehicle.empty() ? tag_of(tags, "one_way") : vehicle;
  return is_drivable(kind_of(tags)) && !value.empty() && !is_yes(value);
}

Polyline line_of(const OsmFile& osm, const LocalFrame& frame, const Bound& bound,
                 const XmlElement& user) {
  std::vector<Eigen::Vector2d> points;
  for (const std::int64_t node : bound.nodes) {
    points.emplace_back(frame.enu_from_geodetic(osm.node(node, user)).head<2>());
    if (!(points.back().norm() < kLanelet2Lanes.extent_max_m)) {
      user.fail(fmt::format("node {} within {:g} m of the middle of the map", node,
                            kLanelet2Lanes.extent_max_m),
                fmt::format("{:g} m", points.back().norm()));
    }
  }
  try {
    return Polyline(points);
  } catch (const std::invalid_argument&) {
    user.fail("two different places on each side of a lanelet", "one");
  }
}

// Both lines by as many points: each by its own, and by those that lie opposite of the other's, at
// the same part of the way.
std::pair<std::vector<Eigen::Vector2d>, std::vector<Eigen::Vector2d>> matched(
    const Polyline& left, const Polyline& right) {
  std::vector<double> parts;
  for (const Polyline* line : {&left, &right}) {
    for (const double along : line->arclengths_m()) {
      parts.push_back(along / line->length_m());
    }
  }
  std::ranges::sort(parts);
  const double longer_m = std::max(left.length_m(), right.length_m());
  std::vector<double> kept{0.0};
  for (const double part : parts) {
    const double gap_m = std::min(part - kept.back(), 1.0 - part) * longer_m;
    if (gap_m > kLanelet2Lanes.opposite_m) {
      kept.push_back(part);
    }
  }
  kept.push_back(1.0);
  const auto points = [&](const Polyline& line) {
    std::vector<Eigen::Vector2d> result;
    for (const double part : kept) {
      result.push_back(line.point_at(part * line.length_m()));
    }
    result.front() = line.points_m().front();
    result.back() = line.points_m().back();
    return result;
  };
  return {points(left), points(right)};
}

// A lane, and the nodes that its bounds go through in its direction.
struct Directed {
  MapLane lane;
  Bound left;
  Bound right;
  XmlElement element;

  [[nodiscard]] bool is_drivable() const { return ads::is_drivable(lane.kind); }
};

Directed reversed(Directed lane) {
  std::swap(lane.left, lane.right);
  lane.left.reverse();
  lane.right.reverse();
  std::swap(lane.lane.left_m, lane.lane.right_m);
  std::ranges::reverse(lane.lane.left_m);
  std::ranges::reverse(lane.lane.right_m);
  lane.lane.id = -lane.lane.id;
  lane.lane.name += ", reversed";
  return lane;
}

class LaneletReader {
 public:
  LaneletReader(const OsmFile& osm, const MapLimits& limits) : osm_(osm), limits_(limits) {}

  GeoreferencedLanes read() {
    read_lanelets();
    const GeodeticPosition origin = middle();
    const LocalFrame frame(origin);
    for (const auto& [id, sides] : sides_) {
      add_lanes(id, sides.first, sides.second, frame);
    }
    link_ends();
    link_sides();
    for (const auto& [id, relation] : osm_.relations()) {
      if (tag_of(relation.tags, "type") == "regulatory_element") {
        add_rule(id, relation, frame);
      }
    }
    pass_on_priorities();
    GeoreferencedLanes result{.origin = origin};
    for (auto& [id, lane] : lanes_) {
      result.lanes.push_back(std::move(lane.lane));
    }
    return result;
  }

 private:
  void read_lanelets() {
    std::size_t points = 0;
    for (const auto& [id, relation] : osm_.relations()) {
      if (tag_of(relation.tags, "type") == "lanelet") {
        Bound left = read_bound(osm_, relation, "left", limits_.points, points);
        Bound right = read_bound(osm_, relation, "right", limits_.points, points);
        sides_.emplace(id, std::pair(std::move(left), std::move(right)));
        for (const OsmRelation::Member& member : relation.members) {
          if (member.role == "regulatory_element") {
            (void)osm_.relation(member.id, member.element);
            holders_[member.id].push_back(id);
          }
        }
      }
    }
  }

  [[nodiscard]] GeodeticPosition middle() const {
    double south = 90.0, north = -90.0, west = 180.0, east = -180.0;
    for (const auto& [id, sides] : sides_) {
      for (const Bound* bound : {&sides.first, &sides.second}) {
        for (const std::int64_t node : bound->nodes) {
          const auto& place = osm_.node(node, osm_.relations().at(id).element);
          south = std::min(south, place.latitude_deg);
          north = std::max(north, place.latitude_deg);
          west = std::min(west, place.longitude_deg);
          east = std::max(east, place.longitude_deg);
        }
      }
    }
    return {.latitude_deg = (south + north) / 2.0, .longitude_deg = (west + east) / 2.0};
  }

  void add_lanes(std::int64_t id, Bound left, Bound right, const LocalFrame& frame) {
    const OsmRelation& relation = osm_.relations().at(id);
    Polyline left_line = line_of(osm_, frame, left, relation.element);
    Polyline right_line = line_of(osm_, frame, right, relation.element);
    // Ways may have either direction; their roles as left and right determine that of the lane.
    const bool is_left_reversed =
        left_line.project(right_line.point_at(right_line.length_m() / 2.0)).offset_m > 0.0;
    const bool is_right_reversed =
        right_line.project(left_line.point_at(left_line.length_m() / 2.0)).offset_m < 0.0;
    if (is_left_reversed) {
      left.reverse();
      left_line = line_of(osm_, frame, left, relation.element);
    }
    if (is_right_reversed) {
      right.reverse();
      right_line = line_of(osm_, frame, right, relation.element);
    }
    auto [left_m, right_m] = matched(left_line, right_line);
    Directed lane{.lane = {.id = id,
                           .name = fmt::format("lanelet {}", id),
                           .kind = kind_of(relation.tags),
                           .left_m = std::move(left_m),
                           .right_m = std::move(right_m),
                           .speed_limit_mps = speed_limit_mps(relation),
                           .is_in_intersection = relation.tags.contains("turn_direction")},
                  .left = std::move(left),
                  .right = std::move(right),
                  .element = relation.element};
    if (is_two_way(relation.tags)) {
      emplace(reversed(lane));
    }
    emplace(std::move(lane));
  }

  void emplace(Directed lane) {
    const std::int64_t id = lane.lane.id;
    const XmlElement element = lane.element;
    if (!lanes_.emplace(id, std::move(lane)).second) {
      element.fail(fmt::format("no lanelet {} beside lanelet {} that is driven both ways",
                               std::abs(id), -std::abs(id)),
                   "one");
    }
  }

  // A lane follows another where both its bounds begin where the other's end.
  void link_ends() {
    std::map<std::tuple<std::int64_t, std::int64_t, bool>, std::vector<std::int64_t>> begins;
    for (const auto& [id, lane] : lanes_) {
      begins[{lane.left.nodes.front(), lane.right.nodes.front(), lane.is_drivable()}].push_back(id);
    }
    for (auto& [id, lane] : lanes_) {
      const auto found =
          begins.find({lane.left.nodes.back(), lane.right.nodes.back(), lane.is_drivable()});
      if (found == begins.end()) {
        continue;
      }
      if (found->second.size() > kLinksMax) {
        lane.element.fail(fmt::format("at most {} lanelets that follow it", kLinksMax),
                          fmt::format("{}", found->second.size()));
      }
      for (const std::int64_t next : found->second) {
        if (next != id && next != -id) {
          lane.lane.successors.push_back(next);
          lanes_.at(next).lane.predecessors.push_back(id);
        }
      }
    }
  }

  // Lanes lie side by side where they share a bound.
  void link_sides() {
    using Lanes = std::map<std::vector<std::int64_t>, std::vector<std::int64_t>>;
    Lanes lefts;
    Lanes rights;
    for (const auto& [id, lane] : lanes_) {
      auto& on_left = lefts[lane.left.nodes];
      auto& on_right = rights[lane.right.nodes];
      on_left.push_back(id);
      on_right.push_back(id);
      if (std::max(on_left.size(), on_right.size()) > kLinksMax) {
        lane.element.fail(fmt::format("at most {} lanelets with the same side", kLinksMax), "more");
      }
    }
    for (auto& [id, lane] : lanes_) {
      lane.lane.left = beside(id, lane.left, rights, lefts, lane.left.crossing.to_left);
      lane.lane.right = beside(id, lane.right, lefts, rights, lane.right.crossing.to_right);
    }
  }

  // The lane beyond the bound: of several one that is driven, and one in the same direction, before
  // others.
  [[nodiscard]] std::optional<LaneBeside> beside(std::int64_t id, const Bound& bound,
                                                 const auto& same, const auto& opposite,
                                                 bool is_change_allowed) const {
    std::optional<LaneBeside> best;
    bool is_best_drivable = false;
    const auto take = [&](const auto& lanes, const std::vector<std::int64_t>& nodes,
                          bool is_same_direction) {
      const auto found = lanes.find(nodes);
      if (found == lanes.end()) {
        return;
      }
      for (const std::int64_t other : found->second) {
        const bool is_drivable = lanes_.at(other).is_drivable();
        if (other != id && other != -id && (!best || (is_drivable && !is_best_drivable))) {
          best = {.id = other,
                  .is_same_direction = is_same_direction,
                  .is_change_allowed = is_same_direction && is_change_allowed};
          is_best_drivable = is_drivable;
        }
      }
    };
    take(same, bound.nodes, true);
    take(opposite, {bound.nodes.rbegin(), bound.nodes.rend()}, false);
    return best;
  }

  // The lane of a lanelet, and that of its other direction.
  template <typename Change>
  void change_lanes(std::int64_t lanelet, const Change& change) {
    for (const std::int64_t id : std::set<std::int64_t>{lanelet, -lanelet}) {
      const auto found = lanes_.find(id);
      if (found != lanes_.end() && (id == lanelet || !sides_.contains(id))) {
        change(found->second.lane);
      }
    }
  }

  void add_rule(std::int64_t id, const OsmRelation& rule, const LocalFrame& frame) {
    const auto holders = holders_.find(id);
    const std::vector<std::int64_t> held_by =
        holders == holders_.end() ? std::vector<std::int64_t>{} : holders->second;
    const std::string_view subtype = tag_of(rule.tags, "subtype");
    if (subtype == "right_of_way") {
      set_priority(lanelets_of(rule, "right_of_way"), 1);
      const auto yielding = lanelets_of(rule, "yield");
      set_priority(yielding, -1);
      set_stop_line(yielding, rule, frame);
    } else if (subtype == "traffic_light") {
      set_stop_line(held_by, rule, frame);
    } else if (subtype == "traffic_sign") {
      add_signs(held_by, rule, frame);
    } else if (subtype == "speed_limit") {
      add_speed_limit(held_by, rule);
    }
  }

  [[nodiscard]] std::vector<std::int64_t> lanelets_of(const OsmRelation& rule,
                                                      std::string_view role) const {
    std::vector<std::int64_t> lanelets;
    for (const OsmRelation::Member& member : rule.members) {
      if (member.role == role && member.type == "relation") {
        (void)osm_.relation(member.id, member.element);
        lanelets.push_back(member.id);
      }
    }
    return lanelets;
  }

  // The signs that a rule refers to, as their ways call them.
  [[nodiscard]] std::vector<std::string_view> signs_of(const OsmRelation& rule) const {
    std::vector<std::string_view> signs{tag_of(rule.tags, "sign_type")};
    for (const OsmRelation::Member& member : rule.members) {
      if (member.role == "refers" && member.type == "way") {
        signs.push_back(tag_of(tags_of(osm_.way(member.id, member.element).element), "subtype"));
      }
    }
    return signs;
  }

  void set_priority(const std::vector<std::int64_t>& lanelets, int priority) {
    for (const std::int64_t lanelet : lanelets) {
      change_lanes(lanelet, [&](MapLane& lane) {
        lane.priority = lane.priority < 0 ? lane.priority : priority;
      });
    }
  }

  // A rule's lanelets lie before an intersection, and what conflicts lies in it: priority holds for
  // those that follow, up to where lanes from elsewhere join them.
  void pass_on_priorities() {
    std::vector<std::pair<std::int64_t, double>> open;
    for (const auto& [id, lane] : lanes_) {
      if (lane.lane.priority != 0) {
        open.emplace_back(id, kLanelet2Lanes.intersection_m);
      }
    }
    while (!open.empty()) {
      const auto [id, left_m] = open.back();
      open.pop_back();
      const MapLane& lane = lanes_.at(id).lane;
      for (const std::int64_t next : lane.successors) {
        MapLane& following = lanes_.at(next).lane;
        if (following.priority == 0 && following.predecessors.size() == 1 && left_m > 0.0) {
          following.priority = lane.priority;
          const double length_m = (following.left_m.back() - following.left_m.front()).norm();
          open.emplace_back(next, left_m - length_m);
        }
      }
    }
  }

  // At the rule's line, where it is nearer to a lane's end than to its begin; without one, at the
  // lane's end.
  void set_stop_line(const std::vector<std::int64_t>& lanelets, const OsmRelation& rule,
                     const LocalFrame& frame) {
    std::optional<std::array<Eigen::Vector2d, 2>> line;
    for (const OsmRelation::Member& member : rule.members) {
      if (member.role == "ref_line" && member.type == "way") {
        const OsmWay& way = osm_.way(member.id, member.element);
        if (way.nodes.empty()) {
          way.element.fail("<nd> in a stop line", "none");
        }
        const auto place = [&](std::int64_t node) -> Eigen::Vector2d {
          return frame.enu_from_geodetic(osm_.node(node, way.element)).head<2>();
        };
        line = {place(way.nodes.front()), place(way.nodes.back())};
      }
    }
    for (const std::int64_t lanelet : lanelets) {
      change_lanes(lanelet, [&](MapLane& lane) {
        const std::array<Eigen::Vector2d, 2> end{lane.left_m.back(), lane.right_m.back()};
        auto ends = line.value_or(end);
        const Eigen::Vector2d middle = (ends[0] + ends[1]) / 2.0;
        if ((middle - (end[0] + end[1]) / 2.0).norm() >
            (middle - (lane.left_m.front() + lane.right_m.front()) / 2.0).norm()) {
          return;
        }
        if ((ends[0] - end[0]).norm() > (ends[1] - end[0]).norm()) {
          std::swap(ends[0], ends[1]);
        }
        lane.stop_line = ends;
      });
    }
  }

  void add_signs(const std::vector<std::int64_t>& lanelets, const OsmRelation& rule,
                 const LocalFrame& frame) {
    constexpr std::string_view kStop = "de206";
    constexpr std::array<std::string_view, 2> kYield{"de205", kStop};
    constexpr std::array<std::string_view, 2> kPriority{"de301", "de306"};
    for (const std::string_view sign : signs_of(rule)) {
      if (is_one_of(kYield, sign)) {
        set_priority(lanelets, -1);
        set_stop_line(lanelets, rule, frame);
        if (sign == kStop) {
          for (const std::int64_t lanelet : lanelets) {
            change_lanes(lanelet, [](MapLane& lane) { lane.has_stop_sign = true; });
          }
        }
      } else if (is_one_of(kPriority, sign)) {
        set_priority(lanelets, 1);
      }
    }
  }

  void add_speed_limit(const std::vector<std::int64_t>& lanelets, const OsmRelation& rule) {
    for (const std::string_view sign : signs_of(rule)) {
      const auto limit = speed_of_sign_mps(sign);
      for (const std::int64_t lanelet : limit ? lanelets : std::vector<std::int64_t>{}) {
        change_lanes(lanelet, [&](MapLane& lane) { lane.speed_limit_mps = *limit; });
      }
    }
  }

  const OsmFile& osm_;
  MapLimits limits_;
  std::map<std::int64_t, std::pair<Bound, Bound>> sides_;
  std::map<std::int64_t, std::vector<std::int64_t>> holders_;
  std::map<std::int64_t, Directed> lanes_;
};

}  // namespace

GeoreferencedLanes lanelet2_lanes(std::string_view text, std::string_view name,
                                  const MapLimits& limits) {
  const XmlFile file(text, name);
  const XmlElement root = file.root();
  const OsmFile osm(root);
  GeoreferencedLanes result = LaneletReader(osm, limits).read();
  if (result.lanes.empty()) {
    root.fail("a relation of type=lanelet in <osm>", "none");
  }
  return result;
}

}  // namespace ads

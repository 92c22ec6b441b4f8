#include "opendrive_lanes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include <Eigen/Core>
#include <fmt/format.h>

#include "common/plane.h"
#include "common/xml.h"
#include "hd_map_tuning.h"
#include "plan_view.h"
#include "words.h"

namespace ads {
namespace {

enum class End : std::uint8_t { kStart, kEnd };

struct Lane {
  XmlElement element;
  int number = 0;  // As the file calls it: above 0 to the left of the reference line.
  std::string_view type = {};
  std::vector<Cubic> widths = {};
  std::vector<int> predecessors = {};
  std::vector<int> successors = {};
  double speed_limit_mps = 0.0;
  bool is_along = true;  // Whether it is driven in the direction of s.
  std::int64_t id = 0;

  [[nodiscard]] End entry() const { return is_along ? End::kStart : End::kEnd; }
};

struct Section {
  double begin_m = 0.0;
  double end_m = 0.0;
  std::map<int, Lane> lanes = {};
};

struct Link {
  XmlElement element;
  bool is_junction = false;
  std::string_view id = {};
  std::optional<End> contact = {};
};

struct TypeFrom {
  double s_m = 0.0;
  std::string_view type = {};
  double speed_limit_mps = 0.0;
};

struct Road {
  XmlElement element;
  std::string_view id = {};
  bool is_in_junction = false;
  PlanView plan;
  std::vector<TypeFrom> types = {};
  std::vector<Cubic> offsets = {};
  std::vector<Section> sections = {};
  std::optional<Link> predecessor = {};
  std::optional<Link> successor = {};

  [[nodiscard]] const Section& section_at(End end) const {
    return end == End::kStart ? sections.front() : sections.back();
  }
  [[nodiscard]] const std::optional<Link>& link_at(End end) const {
    return end == End::kStart ? predecessor : successor;
  }
};

std::vector<Cubic> read_cubics(const XmlElement& element, const char* name, const char* place) {
  std::vector<Cubic> cubics;
  for (const XmlElement& child : element.all(name)) {
    cubics.push_back({.s_m = child.number_attribute<double>(place),
                      .a = child.number_attribute<double>("a"),
                      .b = child.number_attribute<double>("b"),
                      .c = child.number_attribute<double>("c"),
                      .d = child.number_attribute<double>("d")});
    if (cubics.size() > 1 && !(cubics.back().s_m >= cubics[cubics.size() - 2].s_m)) {
      child.fail(fmt::format("{} of <{}> in ascending order", place, name),
                 fmt::format("{:g} after {:g}", cubics.back().s_m, cubics[cubics.size() - 2].s_m));
    }
  }
  return cubics;
}

// 0 where there is no limit.
double read_speed_mps(const XmlElement& element) {
  const std::string_view max = element.attribute("max");
  if (max == "no limit" || max == "undefined") {
    return 0.0;
  }
  static const std::map<std::string_view, double> kUnits{
      {"", 1.0}, {"m/s", 1.0}, {"km/h", 1.0 / 3.6}, {"mph", 0.44704}};
  const std::string_view unit = element.find_attribute("unit").value_or("");
  const auto found = kUnits.find(unit);
  if (found == kUnits.end()) {
    element.fail("unit m/s, km/h or mph of <speed>", XmlElement::quoted(unit));
  }
  const auto speed = element.number_attribute<double>("max");
  if (speed < 0.0) {
    element.fail("max of <speed> of 0 or more", fmt::format("{:g}", speed));
  }
  return speed * found->second;
}

// The lower one of two limits, of which 0 is none.
double lower_limit(double a, double b) {
  return a == 0.0 || b == 0.0 ? std::max(a, b) : std::min(a, b);
}

End read_contact(const XmlElement& element) {
  const std::string_view contact = element.attribute("contactPoint");
  if (contact != "start" && contact != "end") {
    element.fail(fmt::format("contactPoint start or end of <{}>", element.name()),
                 XmlElement::quoted(contact));
  }
  return contact == "start" ? End::kStart : End::kEnd;
}

std::vector<int> read_lane_links(const XmlElement& element, const char* name) {
  std::vector<int> numbers;
  if (const auto link = element.find("link")) {
    for (const XmlElement& child : link->all(name)) {
      numbers.push_back(child.number_attribute<int>("id"));
    }
  }
  return numbers;
}

// Whether the lane's mark may be crossed all along, to the lane with a higher or a lower number.
bool may_cross(const Lane& lane, bool is_up) {
  constexpr std::array<std::string_view, 3> kCrossable{"broken", "broken broken", "none"};
  return std::ranges::all_of(lane.element.all("roadMark"), [&](const XmlElement& mark) {
    const auto change = mark.find_attribute("laneChange");
    return change ? *change == "both" || *change == (is_up ? "increase" : "decrease")
                  : is_one_of(kCrossable, mark.attribute("type"));
  });
}

LaneKind kind_of(const Lane& lane, std::string_view road_type) {
  constexpr std::array<std::string_view, 2> kRoad{"driving", "slipLane"};
  constexpr std::array<std::string_view, 5> kRamp{"entry", "exit", "onRamp", "offRamp",
                                                  "connectingRamp"};
  constexpr std::array<std::string_view, 2> kShoulder{"shoulder", "stop"};
  if (is_one_of(kRoad, lane.type)) {
    return road_type == "motorway" ? LaneKind::kHighway : LaneKind::kRoad;
  }
  return is_one_of(kRamp, lane.type)       ? LaneKind::kRamp
         : is_one_of(kShoulder, lane.type) ? LaneKind::kShoulder
                                           : LaneKind::kOther;
}

Lane read_lane(const XmlElement& element, bool is_left_hand) {
  Lane lane{.element = element,
            .number = element.number_attribute<int>("id"),
            .type = element.attribute("type"),
            .widths = read_cubics(element, "width", "sOffset"),
            .predecessors = read_lane_links(element, "predecessor"),
            .successors = read_lane_links(element, "successor")};
  for (const XmlElement& speed : element.all("speed")) {
    lane.speed_limit_mps = lower_limit(lane.speed_limit_mps, read_speed_mps(speed));
  }
  const bool is_reversed = element.find_attribute("direction") == "reversed";
  lane.is_along = (lane.number < 0) != is_left_hand;
  lane.is_along = lane.is_along != is_reversed;
  return lane;
}

Section read_section(const XmlElement& element, bool is_left_hand) {
  Section section{.begin_m = element.number_attribute<double>("s")};
  for (const char* side : {"left", "center", "right"}) {
    for (const XmlElement& group : element.all(side)) {
      for (const XmlElement& child : group.all("lane")) {
        Lane lane = read_lane(child, is_left_hand);
        const int number = lane.number;
        if (!section.lanes.emplace(number, std::move(lane)).second) {
          child.fail(fmt::format("no second lane {} in the section", number), "one");
        }
      }
    }
  }
  for (const auto& [number, lane] : section.lanes) {
    const int inner = number > 0 ? number - 1 : number + 1;
    if (inner != 0 && number != 0 && !section.lanes.contains(inner)) {
      lane.element.fail(fmt::format("lane {} between lane {} and the middle", inner, number),
                        "none");
    }
  }
  return section;
}

std::optional<Link> read_link(const XmlElement& road, const char* name) {
  const auto links = road.find("link");
  const auto link = links ? links->find(name) : std::nullopt;
  if (!link) {
    return std::nullopt;
  }
  const std::string_view type = link->attribute("elementType");
  if (type != "road" && type != "junction") {
    link->fail(fmt::format("elementType road or junction of <{}>", name), XmlElement::quoted(type));
  }
  Link read{
      .element = *link, .is_junction = type == "junction", .id = link->attribute("elementId")};
  if (!read.is_junction) {
    read.contact = read_contact(*link);
  }
  return read;
}

std::vector<TypeFrom> read_types(const XmlElement& road) {
  std::vector<TypeFrom> types;
  for (const XmlElement& type : road.all("type")) {
    const auto speed = type.find("speed");
    types.push_back({.s_m = type.number_attribute<double>("s"),
                     .type = type.attribute("type"),
                     .speed_limit_mps = speed ? read_speed_mps(*speed) : 0.0});
  }
  std::ranges::sort(types, {}, [](const TypeFrom& type) {
    return std::tuple(type.s_m, type.type, type.speed_limit_mps);
  });
  return types;
}

void read_sections(const XmlElement& lanes, Road& road) {
  const bool is_left_hand = road.element.find_attribute("rule") == "LHT";
  const double length_m = road.plan.length_m();
  for (const XmlElement& element : lanes.all("laneSection")) {
    Section section = read_section(element, is_left_hand);
    const double least_m = road.sections.empty()
                               ? -kOpendriveLanes.same_m
                               : road.sections.back().begin_m + kOpendriveLanes.same_m;
    if (!(section.begin_m >= least_m && section.begin_m + kOpendriveLanes.same_m <= length_m)) {
      element.fail(fmt::format("<laneSection> at s from {:g} to less than {:g}",
                               std::max(0.0, least_m), length_m),
                   fmt::format("{:g}", section.begin_m));
    }
    if (!road.sections.empty()) {
      road.sections.back().end_m = section.begin_m;
    }
    section.end_m = length_m;
    road.sections.push_back(std::move(section));
  }
  if (road.sections.empty()) {
    lanes.fail("<laneSection> in <lanes>", "none");
  }
}

Road read_road(const XmlElement& element, double longest_m) {
  const XmlElement lanes = element.get("lanes");
  Road road{.element = element,
            .id = element.attribute("id"),
            .is_in_junction = element.find_attribute("junction").value_or("-1") != "-1",
            .plan = PlanView(element.get("planView"), longest_m),
            .types = read_types(element),
            .offsets = read_cubics(lanes, "laneOffset", "s"),
            .predecessor = read_link(element, "predecessor"),
            .successor = read_link(element, "successor")};
  const auto length_m = element.number_attribute<double>("length");
  if (!(std::abs(length_m - road.plan.length_m()) <= kOpendriveLanes.length_error_m)) {
    element.fail(fmt::format("length of about {:.3f} m, that of the road's geometries",
                             road.plan.length_m()),
                 fmt::format("{:g}", length_m));
  }
  read_sections(lanes, road);
  return road;
}

// The positions of a section at which its bounds are sampled.
std::vector<double> places_of(const Road& road, const Section& section) {
  const double length_m = section.end_m - section.begin_m;
  const auto steps = static_cast<std::size_t>(std::ceil(length_m / kOpendriveLanes.step_m));
  std::vector<double> places;
  for (std::size_t step = 0; step < steps; ++step) {
    places.push_back(section.begin_m +
                     length_m * static_cast<double>(step) / static_cast<double>(steps));
  }
  const auto add = [&](double s_m) {
    if (s_m > section.begin_m && s_m < section.end_m) {
      places.push_back(s_m);
    }
  };
  std::ranges::for_each(road.plan.begins_m(), add);
  for (const auto& [number, lane] : section.lanes) {
    for (const Cubic& width : lane.widths) {
      add(section.begin_m + width.s_m);
    }
  }
  std::ranges::sort(places);
  std::vector<double> kept;
  for (const double place : places) {
    if ((kept.empty() || place - kept.back() > kOpendriveLanes.same_m) &&
        section.end_m - place > kOpendriveLanes.same_m) {
      kept.push_back(place);
    }
  }
  kept.push_back(section.end_m);
  return kept;
}

using Line = std::vector<Eigen::Vector2d>;

// The edges of the lanes of a section from the middle, which is 0, to each side.
std::map<int, Line> edges_of(const Road& road, const Section& section,
                             const std::vector<double>& places_m) {
  std::map<int, Line> edges{{0, {}}};
  for (const double s_m : places_m) {
    const PlanView::Pose pose = road.plan.at(s_m);
    const Eigen::Vector2d left = left_of(direction(pose.heading_rad));
    const double middle = value_at(road.offsets, s_m);
    edges[0].emplace_back(pose.position_m + middle * left);
    for (const int side : {1, -1}) {
      double edge = middle;
      for (auto lane = section.lanes.find(side); lane != section.lanes.end();
           lane = section.lanes.find(lane->first + side)) {
        edge += side * std::max(0.0, value_at(lane->second.widths, s_m - section.begin_m));
        edges[lane->first].emplace_back(pose.position_m + edge * left);
      }
    }
  }
  return edges;
}

class OpenDriveReader {
 public:
  OpenDriveReader(const XmlElement& root, const MapLimits& limits) : root_(root), limits_(limits) {
    double length_m = 0.0;
    for (const XmlElement& element : root.all("road")) {
      Road road = read_road(element, limits.roads_length_m - length_m);
      length_m += road.plan.length_m();
      if (!roads_.emplace(road.id, roads_list_.size()).second) {
        element.fail(fmt::format("no second road '{}'", road.id.substr(0, 40)), "one");
      }
      roads_list_.push_back(std::move(road));
    }
  }

  std::vector<MapLane> read() {
    for (Road& road : roads_list_) {
      number_lanes(road);
    }
    if (lanes_.empty()) {
      root_.fail("<lane> in a <road>", "none");
    }
    for (const Road& road : roads_list_) {
      link_sections(road);
      link_end(road, End::kStart);
      link_end(road, End::kEnd);
    }
    for (const XmlElement& junction : root_.all("junction")) {
      if (junction.find_attribute("type") != "virtual") {
        link_junction(junction);
      }
    }
    return std::move(lanes_);
  }

 private:
  [[nodiscard]] const Road& road(std::string_view id, const XmlElement& user) const {
    const auto found = roads_.find(id);
    if (found == roads_.end()) {
      user.fail(fmt::format("road '{}', to which this <{}> refers", id.substr(0, 40), user.name()),
                "none");
    }
    return roads_list_[found->second];
  }

  static const Lane& lane(const Section& section, int number, const XmlElement& user) {
    const auto found = section.lanes.find(number);
    if (found == section.lanes.end() || number == 0) {
      user.fail(fmt::format("lane {}, to which this <{}> refers", number, user.name()), "none");
    }
    return found->second;
  }

  void number_lanes(Road& road) {
    for (std::size_t index = 0; index < road.sections.size(); ++index) {
      Section& section = road.sections[index];
      for (auto& [number, lane] : section.lanes) {
        if (number != 0) {
          lane.id = ++last_id_;
        }
      }
      const std::vector<double> places = places_of(road, section);
      points_ += 2 * places.size() * section.lanes.size();
      if (points_ > limits_.points) {
        road.element.fail(fmt::format("at most {} points of all lanes' bounds", limits_.points),
                          "more");
      }
      const auto edges = edges_of(road, section, places);
      for (const auto& [number, lane] : section.lanes) {
        if (number != 0) {
          lanes_.push_back(map_lane(road, index, lane, edges));
        }
      }
    }
  }

  MapLane map_lane(const Road& road, std::size_t index, const Lane& lane,
                   const std::map<int, Line>& edges) {
    const Section& section = road.sections[index];
    const int inner = lane.number > 0 ? lane.number - 1 : lane.number + 1;
    const auto type = type_of(road, section);
    MapLane made{
        .id = lane.id,
        .name = fmt::format("road {}, section {}, lane {}", road.id, index, lane.number),
        .kind = kind_of(lane, type.type),
        .left_m = edges.at(std::max(inner, lane.number)),
        .right_m = edges.at(std::min(inner, lane.number)),
        .left = beside(section, lane, true),
        .right = beside(section, lane, false),
        .speed_limit_mps = lane.speed_limit_mps > 0.0 ? lane.speed_limit_mps : type.speed_limit_mps,
        .is_in_intersection = road.is_in_junction};
    if (!lane.is_along) {
      std::swap(made.left_m, made.right_m);
      std::swap(made.left, made.right);
      std::ranges::reverse(made.left_m);
      std::ranges::reverse(made.right_m);
    }
    return made;
  }

  // The type where the section begins, and the lowest limit along it.
  static TypeFrom type_of(const Road& road, const Section& section) {
    TypeFrom found;
    for (std::size_t index = 0; index < road.types.size(); ++index) {
      const TypeFrom& type = road.types[index];
      const bool is_last = index + 1 == road.types.size();
      if (type.s_m <= section.begin_m) {
        found.type = type.type;
      }
      if (type.s_m < section.end_m && (is_last || road.types[index + 1].s_m > section.begin_m)) {
        found.speed_limit_mps = lower_limit(found.speed_limit_mps, type.speed_limit_mps);
      }
    }
    return found;
  }

  // The lane to the left, seen along s, or to the right. The line between them is the mark of the
  // one nearer to the middle, or of the middle.
  static std::optional<LaneBeside> beside(const Section& section, const Lane& lane, bool is_left) {
    const int step = is_left ? 1 : -1;
    const int next = lane.number + step == 0 ? step : lane.number + step;
    const auto other = section.lanes.find(next);
    if (other == section.lanes.end()) {
      return std::nullopt;
    }
    const bool is_across = lane.number + step == 0;
    const int marked =
        is_across ? 0 : (std::abs(next) < std::abs(lane.number) ? next : lane.number);
    const auto mark = section.lanes.find(marked);
    return LaneBeside{
        .id = other->second.id,
        .is_same_direction = other->second.is_along == lane.is_along,
        .is_change_allowed = mark == section.lanes.end() || may_cross(mark->second, is_left)};
  }

  void link_sections(const Road& road) {
    for (std::size_t index = 0; index + 1 < road.sections.size(); ++index) {
      const Section& before = road.sections[index];
      const Section& after = road.sections[index + 1];
      for (const auto& [number, from] : before.lanes) {
        for (const int to : number == 0 ? std::vector<int>{} : from.successors) {
          join(from, End::kEnd, lane(after, to, from.element), End::kStart);
        }
      }
      for (const auto& [number, to] : after.lanes) {
        for (const int from : number == 0 ? std::vector<int>{} : to.predecessors) {
          join(lane(before, from, to.element), End::kEnd, to, End::kStart);
        }
      }
    }
  }

  // Where the road leads to another one, its lanes contain the links to that road's lanes.
  void link_end(const Road& from, End end) {
    const auto& link = from.link_at(end);
    if (!link || link->is_junction) {
      return;
    }
    const Section& other = road(link->id, link->element).section_at(*link->contact);
    for (const auto& [number, own] : from.section_at(end).lanes) {
      const auto& numbers = end == End::kStart ? own.predecessors : own.successors;
      for (const int to : number == 0 ? std::vector<int>{} : numbers) {
        join(own, end, lane(other, to, own.element), *link->contact);
      }
    }
  }

  void link_junction(const XmlElement& junction) {
    const std::string_view id = junction.attribute("id");
    for (const XmlElement& connection : junction.all("connection")) {
      const bool is_direct = connection.find_attribute("linkedRoad").has_value();
      const Road& from = road(connection.attribute("incomingRoad"), connection);
      const Road& to =
          road(connection.attribute(is_direct ? "linkedRoad" : "connectingRoad"), connection);
      const End contact = read_contact(connection);
      const End end = end_at(from, to, contact, id, connection);
      const Section& incoming = from.section_at(end);
      for (const XmlElement& link : connection.all("laneLink")) {
        join(lane(incoming, link.number_attribute<int>("from"), link), end,
             lane(to.section_at(contact), link.number_attribute<int>("to"), link), contact);
      }
    }
    for (const XmlElement& priority : junction.all("priority")) {
      const auto high = priority.find_attribute("high");
      const auto low = priority.find_attribute("low");
      if (high && low) {
        set_priority(road(*high, priority), 1);
        set_priority(road(*low, priority), -1);
      }
    }
  }

  // With which end a road leads into a connection.
  static End end_at(const Road& from, const Road& to, End contact, std::string_view junction,
                    const XmlElement& connection) {
    const auto& back = to.link_at(contact);
    if (back && !back->is_junction && back->id == from.id) {
      return *back->contact;
    }
    for (const End end : {End::kEnd, End::kStart}) {
      const auto& link = from.link_at(end);
      if (link && link->is_junction && link->id == junction) {
        return end;
      }
    }
    connection.fail(fmt::format("road '{}' to lead into junction '{}'", from.id.substr(0, 40),
                                junction.substr(0, 40)),
                    "no such link");
  }

  void set_priority(const Road& road, int priority) {
    for (const Section& section : road.sections) {
      for (const auto& [number, lane] : section.lanes) {
        if (number != 0) {
          int& known = map_lane_of(lane).priority;
          known = known < 0 ? known : priority;
        }
      }
    }
  }

  // Two lanes touch: the one that is driven to there leads into the other, if that is driven away.
  void join(const Lane& a, End end_of_a, const Lane& b, End end_of_b) {
    const bool is_into_b = a.entry() != end_of_a && b.entry() == end_of_b;
    const bool is_into_a = b.entry() != end_of_b && a.entry() == end_of_a;
    if (is_into_b) {
      add(a, b);
    } else if (is_into_a) {
      add(b, a);
    }
  }

  void add(const Lane& from, const Lane& to) {
    auto& successors = map_lane_of(from).successors;
    auto& predecessors = map_lane_of(to).predecessors;
    if (is_one_of_ids(successors, to.id)) {
      return;
    }
    successors.push_back(to.id);
    predecessors.push_back(from.id);
    if (std::max(successors.size(), predecessors.size()) > kLinksMax) {
      from.element.fail(fmt::format("at most {} lanes before or after one", kLinksMax), "more");
    }
  }

  static bool is_one_of_ids(const std::vector<std::int64_t>& ids, std::int64_t id) {
    return std::ranges::find(ids, id) != ids.end();
  }

  [[nodiscard]] MapLane& map_lane_of(const Lane& lane) {
    return lanes_[static_cast<std::size_t>(lane.id - 1)];
  }

  XmlElement root_;
  MapLimits limits_;
  std::vector<Road> roads_list_;
  std::map<std::string_view, std::size_t> roads_;
  std::vector<MapLane> lanes_;  // In the order of their ids, from 1 on.
  std::int64_t last_id_ = 0;
  std::size_t points_ = 0;
};

}  // namespace

std::vector<MapLane> opendrive_lanes(std::string_view text, std::string_view name,
                                     const MapLimits& limits) {
  const XmlFile file(text, name);
  const XmlElement root = file.root();
  if (root.name() != "OpenDRIVE") {
    root.fail("<OpenDRIVE>", fmt::format("<{}>", root.name().substr(0, 40)));
  }
  const XmlElement header = root.get("header");
  if (header.number_attribute<int>("revMajor") != 1) {
    header.fail("revMajor 1 of <header>", XmlElement::quoted(header.attribute("revMajor")));
  }
  return OpenDriveReader(root, limits).read();
}

}  // namespace ads

#include "common/commonroad.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <stdexcept>
#include <system_error>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "common/files.h"
#include "common/xml.h"

namespace ads {
namespace {

// Ten times what published scenarios have; as elements it takes up to half a gigabyte.
constexpr std::uintmax_t kLargestScenario = std::uintmax_t{32} << 20U;
constexpr std::int64_t kLastStep = 10'000'000;

// Numbers of speed limit signs by country: Germany and CommonRoad's Zamunda, the USA, Spain,
// France, Belgium, Greece, Croatia.
constexpr std::array<std::string_view, 8> kSpeedLimitSigns{"274", "274.1", "R2-1", "R301",
                                                           "B14", "C43",   "R32",  "B31"};

using Element = XmlElement;

Eigen::Vector2d read_point(const Element& element) {
  return {element.get("x").number<double>(), element.get("y").number<double>()};
}

double read_positive(const Element& element) {
  const auto value = element.number<double>();
  if (value <= 0.0) {
    element.fail(fmt::format("a number above 0 in <{}>", element.name()),
                 fmt::format("{:g}", value));
  }
  return value;
}

std::int64_t read_id(const Element& element) {
  return element.number_attribute<std::int64_t>("id");
}

std::vector<std::int64_t> read_references(const Element& element, const char* child) {
  std::vector<std::int64_t> ids;
  for (const Element& reference : element.all(child)) {
    ids.push_back(reference.number_attribute<std::int64_t>("ref"));
  }
  return ids;
}

Interval read_interval(const Element& element) {
  if (const auto exact = element.find("exact")) {
    const auto value = exact->number<double>();
    return {.low = value, .high = value};
  }
  const Interval interval{.low = element.get("intervalStart").number<double>(),
                          .high = element.get("intervalEnd").number<double>()};
  if (interval.low > interval.high) {
    element.fail(fmt::format("an interval in <{}>", element.name()),
                 fmt::format("one from {:g} to {:g}", interval.low, interval.high));
  }
  return interval;
}

double read_value(const Element& element) {
  const Interval interval = read_interval(element);
  return (interval.low + interval.high) / 2.0;
}

// The steps that are meant, of times that some files write with a decimal point.
std::pair<std::int64_t, std::int64_t> read_steps(const Element& element) {
  const Interval interval = read_interval(element);
  if (interval.low < 0.0 || interval.high > static_cast<double>(kLastStep)) {
    element.fail(fmt::format("steps from 0 to {} in <{}>", kLastStep, element.name()),
                 fmt::format("{:g} to {:g}", interval.low, interval.high));
  }
  return {static_cast<std::int64_t>(std::ceil(interval.low)),
          static_cast<std::int64_t>(std::floor(interval.high))};
}

std::vector<Eigen::Vector2d> read_points(const Element& element) {
  std::vector<Eigen::Vector2d> points;
  for (const Element& point : element.all("point")) {
    points.push_back(read_point(point));
  }
  return points;
}

Box read_box(const Element& element) {
  Box box{.length_m = read_positive(element.get("length")),
          .width_m = read_positive(element.get("width"))};
  if (const auto center = element.find("center")) {
    box.center_m = read_point(*center);
  }
  if (const auto orientation = element.find("orientation")) {
    box.heading_rad = orientation->number<double>();
  }
  return box;
}

Circle read_circle(const Element& element) {
  Circle circle{.radius_m = read_positive(element.get("radius"))};
  if (const auto center = element.find("center")) {
    circle.center_m = read_point(*center);
  }
  return circle;
}

std::vector<Eigen::Vector2d> read_polygon(const Element& element) {
  std::vector<Eigen::Vector2d> points = read_points(element);
  if (points.size() < 3) {
    element.fail("a polygon of three points or more", fmt::format("{}", points.size()));
  }
  return points;
}

// All that shapes in the plane cover: from corner to corner.
class Extent {
 public:
  void add(const Eigen::Vector2d& point) {
    least_ = least_.cwiseMin(point);
    most_ = most_.cwiseMax(point);
  }
  void add(const Circle& circle) {
    add(circle.center_m - Eigen::Vector2d::Constant(circle.radius_m));
    add(circle.center_m + Eigen::Vector2d::Constant(circle.radius_m));
  }
  [[nodiscard]] bool is_empty() const { return least_.x() > most_.x(); }
  [[nodiscard]] Box box() const {
    const Eigen::Vector2d size = most_ - least_;
    return {.center_m = (least_ + most_) / 2.0, .length_m = size.x(), .width_m = size.y()};
  }

 private:
  Eigen::Vector2d least_ = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d most_ = -least_;
};

Extent read_extent(const Element& element) {
  Extent extent;
  for (const Element& rectangle : element.all("rectangle")) {
    for (const Eigen::Vector2d& corner : read_box(rectangle).corners()) {
      extent.add(corner);
    }
  }
  for (const Element& circle : element.all("circle")) {
    extent.add(read_circle(circle));
  }
  for (const Element& polygon : element.all("polygon")) {
    for (const Eigen::Vector2d& corner : read_polygon(polygon)) {
      extent.add(corner);
    }
  }
  return extent;
}

// The box of an obstacle, as seen from its position and heading.
Box read_shape(const Element& element) {
  const auto rectangles = element.all("rectangle");
  if (rectangles.size() == 1 && !element.has("circle") && !element.has("polygon")) {
    return read_box(rectangles.front());
  }
  const Extent extent = read_extent(element);
  if (extent.is_empty()) {
    element.fail("<rectangle>, <circle> or <polygon> in <shape>", "none");
  }
  return extent.box();
}

Eigen::Vector2d read_position(const Element& element) {
  if (const auto point = element.find("point")) {
    return read_point(*point);
  }
  const Extent extent = read_extent(element);
  if (extent.is_empty()) {
    element.fail("a point, rectangle, circle or polygon in <position>", "none");
  }
  return extent.box().center_m;
}

ScenarioState read_state(const Element& element) {
  ScenarioState state;
  if (const auto time = element.find("time")) {
    const auto [first, last] = read_steps(*time);
    state.step = first + (last - first) / 2;
  }
  state.position_m = read_position(element.get("position"));
  if (const auto orientation = element.find("orientation")) {
    state.heading_rad = read_value(*orientation);
  }
  if (const auto velocity = element.find("velocity")) {
    state.speed_mps = read_value(*velocity);
  }
  return state;
}

Obstacle read_obstacle(const Element& element, bool is_static) {
  Obstacle obstacle{.id = read_id(element), .is_static = is_static};
  if (const auto type = element.find("type")) {
    obstacle.type = type->text();
  }
  const Box shape = read_shape(element.get("shape"));
  obstacle.length_m = shape.length_m;
  obstacle.width_m = shape.width_m;
  obstacle.states.push_back(read_state(element.get("initialState")));
  const auto trajectory = is_static ? std::nullopt : element.find("trajectory");
  if (trajectory) {
    for (const Element& place : trajectory->all("state")) {
      const ScenarioState state = read_state(place);
      if (state.step == obstacle.states.front().step || state.step == obstacle.states.back().step) {
        continue;  // some files contain the initial state, or another one, twice: the first counts
      }
      if (state.step < obstacle.states.back().step) {
        place.fail(fmt::format("a step after {}", obstacle.states.back().step),
                   fmt::format("{}", state.step));
      }
      obstacle.states.push_back(state);
    }
  }
  for (ScenarioState& state : obstacle.states) {
    state.position_m += Eigen::Rotation2Dd(state.heading_rad) * shape.center_m;
    state.heading_rad = normalize_angle(state.heading_rad + shape.heading_rad);
  }
  return obstacle;
}

std::vector<Obstacle> read_obstacles(const Element& root) {
  std::vector<Obstacle> obstacles;
  for (const Element& element : root.all("obstacle")) {
    const Element role = element.get("role");
    if (role.text() != "static" && role.text() != "dynamic") {
      role.fail("'static' or 'dynamic' in <role>", fmt::format("'{}'", role.text().substr(0, 40)));
    }
    obstacles.push_back(read_obstacle(element, role.text() == "static"));
  }
  for (const Element& element : root.all("staticObstacle")) {
    obstacles.push_back(read_obstacle(element, true));
  }
  for (const Element& element : root.all("dynamicObstacle")) {
    obstacles.push_back(read_obstacle(element, false));
  }
  return obstacles;
}

std::optional<Neighbour> read_neighbour(const Element& lanelet, const char* child) {
  const auto element = lanelet.find(child);
  if (!element) {
    return std::nullopt;
  }
  const std::string_view direction = element->attribute("drivingDir");
  if (direction != "same" && direction != "opposite") {
    element->fail(fmt::format("'same' or 'opposite' as drivingDir of <{}>", child),
                  fmt::format("'{}'", direction.substr(0, 40)));
  }
  return Neighbour{.id = element->number_attribute<std::int64_t>("ref"),
                   .is_same_direction = direction == "same"};
}

StopLine read_stop_line(const Element& element) {
  StopLine line;
  const auto points = read_points(element);
  if (points.size() == 2) {
    line.ends_m = {points[0], points[1]};
  } else if (!points.empty()) {
    element.fail("two points of a <stopLine>, or none", fmt::format("{}", points.size()));
  }
  line.signs = read_references(element, "trafficSignRef");
  line.lights = read_references(element, "trafficLightRef");
  return line;
}

std::vector<Eigen::Vector2d> read_bound(const Element& element) {
  std::vector<Eigen::Vector2d> points = read_points(element);
  if (std::ranges::adjacent_find(points, std::ranges::not_equal_to()) == points.end()) {
    element.fail(fmt::format("two different points in <{}>", element.name()),
                 fmt::format("{} alike", points.size()));
  }
  return points;
}

Lanelet read_lanelet(const Element& element) {
  Lanelet lanelet{.id = read_id(element),
                  .left_m = read_bound(element.get("leftBound")),
                  .right_m = read_bound(element.get("rightBound")),
                  .predecessors = read_references(element, "predecessor"),
                  .successors = read_references(element, "successor"),
                  .left = read_neighbour(element, "adjacentLeft"),
                  .right = read_neighbour(element, "adjacentRight"),
                  .signs = read_references(element, "trafficSignRef"),
                  .lights = read_references(element, "trafficLightRef")};
  if (lanelet.left_m.size() != lanelet.right_m.size()) {
    element.fail("as many points in <leftBound> as in <rightBound>",
                 fmt::format("{} and {}", lanelet.left_m.size(), lanelet.right_m.size()));
  }
  for (const Element& type : element.all("laneletType")) {
    lanelet.types.emplace_back(type.text());
  }
  if (const auto stop_line = element.find("stopLine")) {
    lanelet.stop_line = read_stop_line(*stop_line);
  }
  if (const auto limit = element.find("speedLimit")) {
    lanelet.speed_limit_mps = read_positive(*limit);
  }
  return lanelet;
}

std::optional<Eigen::Vector2d> read_place(const Element& element) {
  const auto position = element.find("position");
  const auto point = position ? position->find("point") : std::nullopt;
  return point ? std::optional<Eigen::Vector2d>(read_point(*point)) : std::nullopt;
}

bool is_speed_limit(std::string_view sign) {
  return std::ranges::find(kSpeedLimitSigns, sign) != kSpeedLimitSigns.end();
}

TrafficSign read_sign(const Element& element) {
  TrafficSign sign{.id = read_id(element), .position_m = read_place(element)};
  for (const Element& part : element.all("trafficSignElement")) {
    TrafficSign::Element read{.sign = std::string(part.get("trafficSignID").text())};
    for (const Element& value : part.all("additionalValue")) {
      read.values.emplace_back(value.text());
    }
    if (const auto value = part.find("additionalValue"); value && is_speed_limit(read.sign)) {
      const double limit_mps = read_positive(*value);
      sign.speed_limit_mps = std::min(sign.speed_limit_mps.value_or(limit_mps), limit_mps);
    }
    sign.elements.push_back(std::move(read));
  }
  const auto is_virtual = element.find("virtual");
  sign.is_virtual = is_virtual && is_virtual->text() == "true";
  return sign;
}

TrafficLight read_light(const Element& element) {
  TrafficLight light{.id = read_id(element), .position_m = read_place(element)};
  if (const auto cycle = element.find("cycle")) {
    for (const Element& phase : cycle->all("cycleElement")) {
      light.cycle.push_back({.color = std::string(phase.get("color").text()),
                             .steps = phase.get("duration").number<std::int64_t>()});
    }
    if (const auto offset = cycle->find("timeOffset")) {
      light.offset_steps = offset->number<std::int64_t>();
    }
  }
  if (const auto direction = element.find("direction")) {
    light.direction = direction->text();
  }
  const auto is_active = element.find("active");
  light.is_active = !is_active || is_active->text() == "true";
  return light;
}

Intersection read_intersection(const Element& element) {
  Intersection intersection{.id = read_id(element)};
  for (const Element& part : element.all("incoming")) {
    Intersection::Incoming incoming{.id = read_id(part),
                                    .lanelets = read_references(part, "incomingLanelet"),
                                    .right = read_references(part, "successorsRight"),
                                    .straight = read_references(part, "successorsStraight"),
                                    .left = read_references(part, "successorsLeft")};
    if (const auto left_of = part.find("isLeftOf")) {
      incoming.left_of = left_of->number_attribute<std::int64_t>("ref");
    }
    intersection.incomings.push_back(std::move(incoming));
  }
  for (const Element& crossing : element.all("crossing")) {
    const auto lanelets = read_references(crossing, "crossingLanelet");
    intersection.crossings.insert(intersection.crossings.end(), lanelets.begin(), lanelets.end());
  }
  return intersection;
}

GoalState read_goal(const Element& element) {
  GoalState goal;
  for (const Element& position : element.all("position")) {
    for (const Element& rectangle : position.all("rectangle")) {
      goal.boxes.push_back(read_box(rectangle));
    }
    for (const Element& circle : position.all("circle")) {
      goal.circles.push_back(read_circle(circle));
    }
    for (const Element& polygon : position.all("polygon")) {
      goal.polygons.push_back(read_polygon(polygon));
    }
    const auto lanelets = read_references(position, "lanelet");
    goal.lanelets.insert(goal.lanelets.end(), lanelets.begin(), lanelets.end());
    if (!goal.has_position()) {
      position.fail("a rectangle, circle, polygon or lanelet in <position>", "none");
    }
  }
  if (const auto orientation = element.find("orientation")) {
    goal.heading_rad = read_interval(*orientation);
  }
  if (const auto velocity = element.find("velocity")) {
    goal.speed_mps = read_interval(*velocity);
  }
  const Element time = element.get("time");
  std::tie(goal.first_step, goal.last_step) = read_steps(time);
  if (goal.first_step > goal.last_step) {
    time.fail("a whole step in <time>", "none");
  }
  return goal;
}

PlanningProblem read_problem(const Element& element) {
  PlanningProblem problem{.id = read_id(element),
                          .initial = read_state(element.get("initialState"))};
  for (const Element& goal : element.all("goalState")) {
    problem.goals.push_back(read_goal(goal));
  }
  if (problem.goals.empty()) {
    element.fail("<goalState> in <planningProblem>", "none");
  }
  return problem;
}

// Reads each element `name` of the file into `map`, by its id.
template <typename T>
void read_each(const Element& root, const char* name, T (*read)(const Element&),
               std::map<std::int64_t, T>& map) {
  for (const Element& element : root.all(name)) {
    T value = read(element);
    const std::int64_t id = value.id;
    if (!map.emplace(id, std::move(value)).second) {
      element.fail(fmt::format("no second <{}> {}", name, id), "one");
    }
  }
}

void check_obstacle_ids(const Element& root, const std::vector<Obstacle>& obstacles) {
  std::set<std::int64_t> ids;
  for (const Obstacle& obstacle : obstacles) {
    if (!ids.insert(obstacle.id).second) {
      root.fail(fmt::format("no second obstacle {}", obstacle.id), "one");
    }
  }
}

template <typename T>
void keep_known(std::vector<std::int64_t>& ids, const std::map<std::int64_t, T>& known) {
  std::erase_if(ids, [&](std::int64_t id) { return !known.contains(id); });
}

void keep_known(std::optional<Neighbour>& neighbour, const std::map<std::int64_t, Lanelet>& known) {
  if (neighbour && !known.contains(neighbour->id)) {
    neighbour.reset();
  }
}

void leave_out_unknown(Scenario& scenario) {
  for (auto& [id, lanelet] : scenario.lanelets) {
    keep_known(lanelet.predecessors, scenario.lanelets);
    keep_known(lanelet.successors, scenario.lanelets);
    keep_known(lanelet.left, scenario.lanelets);
    keep_known(lanelet.right, scenario.lanelets);
    keep_known(lanelet.signs, scenario.signs);
    keep_known(lanelet.lights, scenario.lights);
    if (lanelet.stop_line) {
      keep_known(lanelet.stop_line->signs, scenario.signs);
      keep_known(lanelet.stop_line->lights, scenario.lights);
    }
  }
  for (Intersection& intersection : scenario.intersections) {
    for (Intersection::Incoming& incoming : intersection.incomings) {
      keep_known(incoming.lanelets, scenario.lanelets);
      keep_known(incoming.right, scenario.lanelets);
      keep_known(incoming.straight, scenario.lanelets);
      keep_known(incoming.left, scenario.lanelets);
    }
    keep_known(intersection.crossings, scenario.lanelets);
  }
}

// Gives each lanelet the lowest limit of its signs.
void apply_speed_limits(Scenario& scenario) {
  for (auto& [id, lanelet] : scenario.lanelets) {
    for (const std::int64_t sign : lanelet.signs) {
      if (const auto limit_mps = scenario.signs.at(sign).speed_limit_mps) {
        lanelet.speed_limit_mps =
            std::min(lanelet.speed_limit_mps.value_or(*limit_mps), *limit_mps);
      }
    }
  }
}

Scenario read_scenario(const Element& root) {
  if (root.name() != "commonRoad") {
    root.fail("<commonRoad>", fmt::format("<{}>", root.name().substr(0, 40)));
  }
  Scenario scenario{.version = std::string(root.attribute("commonRoadVersion"))};
  if (scenario.version != "2018b" && scenario.version != "2020a") {
    root.fail("commonRoadVersion 2018b or 2020a",
              fmt::format("'{}'", scenario.version.substr(0, 40)));
  }
  scenario.name = root.find_attribute("benchmarkID").value_or("");
  scenario.step_s = root.number_attribute<double>("timeStepSize");
  if (scenario.step_s < 0.001 || scenario.step_s > 10.0) {
    root.fail("a timeStepSize from 0.001 to 10 s", fmt::format("{:g}", scenario.step_s));
  }
  read_each(root, "lanelet", read_lanelet, scenario.lanelets);
  read_each(root, "trafficSign", read_sign, scenario.signs);
  read_each(root, "trafficLight", read_light, scenario.lights);
  for (const Element& intersection : root.all("intersection")) {
    scenario.intersections.push_back(read_intersection(intersection));
  }
  scenario.obstacles = read_obstacles(root);
  check_obstacle_ids(root, scenario.obstacles);
  for (const Element& problem : root.all("planningProblem")) {
    scenario.problems.push_back(read_problem(problem));
  }
  leave_out_unknown(scenario);
  apply_speed_limits(scenario);
  return scenario;
}

}  // namespace

std::vector<Eigen::Vector2d> Lanelet::polygon_m() const {
  std::vector<Eigen::Vector2d> polygon = right_m;
  polygon.insert(polygon.end(), left_m.rbegin(), left_m.rend());
  return polygon;
}

Scenario Scenario::parse(std::string_view text, std::string_view name) {
  const XmlFile file(text, name);
  return read_scenario(file.root());
}

Scenario Scenario::read(const std::filesystem::path& file) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (!error && size > kLargestScenario) {
    throw std::runtime_error(fmt::format("{}: expected a scenario of at most {} bytes, found {}",
                                         file.string(), kLargestScenario, size));
  }
  return parse(read_file(file), file.string());
}

const PlanningProblem& Scenario::problem() const {
  if (problems.empty()) {
    throw std::runtime_error(
        fmt::format("{}: expected a planning problem in the scenario, found none", name));
  }
  return problems.front();
}

}  // namespace ads

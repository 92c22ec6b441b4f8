#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "common/plane.h"

namespace ads {

/// The adjacent lane of a lanelet.
struct Neighbour {
  std::int64_t id = 0;
  bool is_same_direction = false;
};

struct StopLine {
  /// From left to right; without them the line is at the lanelet's end.
  std::optional<std::array<Eigen::Vector2d, 2>> ends_m = {};
  std::vector<std::int64_t> signs = {};
  std::vector<std::int64_t> lights = {};
};

/// A piece of a lane. All lanelets that it references are in the scenario: references to parts of a
/// map that were cut off are left out.
struct Lanelet {
  std::int64_t id = 0;
  /// In driving direction: as many points on the left as on the right, two different ones at least.
  std::vector<Eigen::Vector2d> left_m = {};
  std::vector<Eigen::Vector2d> right_m = {};
  std::vector<std::int64_t> predecessors = {};
  std::vector<std::int64_t> successors = {};
  std::optional<Neighbour> left = {};
  std::optional<Neighbour> right = {};
  /// As named in the file: "urban", "highway", "accessRamp", "crosswalk", ...; none in 2018b.
  std::vector<std::string> types = {};
  std::vector<std::int64_t> signs = {};
  std::vector<std::int64_t> lights = {};
  std::optional<StopLine> stop_line = {};
  /// The lowest limit of its signs, or the lanelet's own limit in 2018b.
  std::optional<double> speed_limit_mps = {};

  /// Its outline: along the right bound, and back along the left one.
  [[nodiscard]] std::vector<Eigen::Vector2d> polygon_m() const;
};

struct TrafficSign {
  struct Element {
    std::string sign = {};  ///< Its number in its country: "274" in Germany, "R2-1" in the USA.
    std::vector<std::string> values = {};
  };
  std::int64_t id = 0;
  std::vector<Element> elements = {};
  std::optional<double> speed_limit_mps = {};  ///< If it is a speed limit sign.
  std::optional<Eigen::Vector2d> position_m = {};
  bool is_virtual = false;
};

struct TrafficLight {
  struct Phase {
    std::string color = {};  ///< "red", "redYellow", "green", "yellow", "inactive".
    std::int64_t steps = 0;
  };
  std::int64_t id = 0;
  std::vector<Phase> cycle = {};
  std::int64_t offset_steps = 0;
  std::optional<Eigen::Vector2d> position_m = {};
  std::string direction = "all";
  bool is_active = true;
};

struct Intersection {
  struct Incoming {
    std::int64_t id = 0;
    std::vector<std::int64_t> lanelets = {};
    std::vector<std::int64_t> right =
        {};  ///< The lanelets through the intersection, by their turn.
    std::vector<std::int64_t> straight = {};
    std::vector<std::int64_t> left = {};
    std::optional<std::int64_t> left_of = {};  ///< The incoming that it is to the left of.
  };
  std::int64_t id = 0;
  std::vector<Incoming> incomings = {};
  std::vector<std::int64_t> crossings = {};  ///< Lanelets that cross it.
};

/// The state of an obstacle at a step. `position_m` is the centre of its box.
struct ScenarioState {
  std::int64_t step = 0;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  double speed_mps = 0.0;
};

/// An obstacle. A shape other than a single rectangle is represented by its smallest bounding box
/// along the heading.
struct Obstacle {
  std::int64_t id = 0;
  bool is_static = false;
  std::string type = {};  ///< "car", "truck", "pedestrian", "parkedVehicle", ...
  double length_m = 0.0;
  double width_m = 0.0;
  /// At least one, in the order of their steps, with at most one for each step.
  std::vector<ScenarioState> states = {};
};

struct Interval {
  double low = 0.0;
  double high = 0.0;
};

struct Circle {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
};

/// A state to reach: all given conditions must hold at one step.
struct GoalState {
  /// The position is in any of these; anywhere if there are none.
  std::vector<Box> boxes = {};
  std::vector<Circle> circles = {};
  std::vector<std::vector<Eigen::Vector2d>> polygons = {};
  std::vector<std::int64_t> lanelets = {};
  /// `low` may be below -pi, or `high` above pi.
  std::optional<Interval> heading_rad = {};
  std::optional<Interval> speed_mps = {};
  std::int64_t first_step = 0;
  std::int64_t last_step = 0;

  [[nodiscard]] bool has_position() const {
    return !boxes.empty() || !circles.empty() || !polygons.empty() || !lanelets.empty();
  }
};

struct PlanningProblem {
  std::int64_t id = 0;
  ScenarioState initial;
  std::vector<GoalState> goals = {};  ///< At least one; any of them is to be reached.
};

/// A scenario of CommonRoad: lanes, obstacles and planning problems. Versions 2018b and 2020a.
/// Metres, radians counter-clockwise from +x, and steps of `step_s`.
///
/// Values that are given as an interval or an area are represented by its middle. Ignored are
/// buildings (environmentObstacle), phantom obstacles, and occupancy sets: an obstacle that has
/// only those keeps its initial state.
///
/// @threads  Compatible.
struct Scenario {
  std::string name = {};     ///< benchmarkID
  std::string version = {};  ///< "2018b", "2020a"
  double step_s = 0.1;
  std::map<std::int64_t, Lanelet> lanelets = {};
  std::map<std::int64_t, TrafficSign> signs = {};
  std::map<std::int64_t, TrafficLight> lights = {};
  std::vector<Intersection> intersections = {};
  std::vector<Obstacle> obstacles = {};
  std::vector<PlanningProblem> problems = {};

  /// @errors  Throws `std::runtime_error` with file, line, what was expected and what was found.
  static Scenario read(const std::filesystem::path& file);
  /// Reads the `text` of a file; `name` is used in error messages.
  static Scenario parse(std::string_view text, std::string_view name);

  /// The only planning problem, or the first of several.
  ///
  /// @errors  Throws `std::runtime_error` if there is none.
  [[nodiscard]] const PlanningProblem& problem() const;
};

}  // namespace ads

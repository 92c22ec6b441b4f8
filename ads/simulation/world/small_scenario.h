#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "common/commonroad.h"

namespace ads::testing {

/// A straight road along +x, 300 m long, with two lanes of 3.5 m: lanelet 1 around y = 0, lanelet 2
/// to its left. The ego vehicle starts at the origin; a test adds everything else.
class SmallScenario {
 public:
  SmallScenario& ego(double speed_mps) {
    ego_speed_mps_ = speed_mps;
    return *this;
  }

  /// A car of 4 m by 2 m that drives along the road at constant speed for `steps` of 0.1 s.
  SmallScenario& car(int id, double x_m, double y_m, double speed_mps, int steps) {
    std::vector<State> states;
    for (int step = 0; step <= steps; ++step) {
      states.push_back(
          {.step = step, .x_m = x_m + speed_mps * step * 0.1, .y_m = y_m, .speed_mps = speed_mps});
    }
    return obstacle("dynamicObstacle", id, states);
  }

  SmallScenario& standing(int id, double x_m, double y_m) {
    return obstacle("staticObstacle", id, {{.step = 0, .x_m = x_m, .y_m = y_m}});
  }

  struct State {
    int step = 0;
    double x_m = 0.0;
    double y_m = 0.0;
    double heading_rad = 0.0;
    double speed_mps = 0.0;
  };

  SmallScenario& obstacle(std::string_view kind, int id, const std::vector<State>& states) {
    content_ += fmt::format(
        "<{} id=\"{}\"><type>car</type><shape><rectangle><length>4</length>"
        "<width>2</width></rectangle></shape>",
        kind, id);
    content_ += state_of("initialState", states.front());
    if (states.size() > 1) {
      content_ += "<trajectory>";
      for (std::size_t index = 1; index < states.size(); ++index) {
        content_ += state_of("state", states[index]);
      }
      content_ += "</trajectory>";
    }
    content_ += fmt::format("</{}>", kind);
    return *this;
  }

  /// A goal at `x_m`, within 2 m, from step `first` to `last`; `more` conditions in the file's
  /// syntax.
  SmallScenario& goal(double x_m, int first, int last, std::string_view more = "") {
    goals_ += fmt::format(
        "<goalState><position><rectangle><length>4</length><width>3</width>"
        "<orientation>0</orientation><center><x>{}</x><y>0</y></center></rectangle></position>"
        "{}<time><intervalStart>{}</intervalStart><intervalEnd>{}</intervalEnd></time>"
        "</goalState>",
        x_m, more, first, last);
    return *this;
  }

  [[nodiscard]] std::string xml() const {
    return fmt::format(
        "<commonRoad commonRoadVersion=\"2020a\" benchmarkID=\"SMALL\" timeStepSize=\"0.1\">"
        "{}{}{}<planningProblem id=\"100\">{}{}</planningProblem></commonRoad>",
        lanelet(1, 0.0), lanelet(2, 3.5), content_,
        state_of("initialState", {.speed_mps = ego_speed_mps_}), goals_);
  }

  [[nodiscard]] Scenario scenario() const { return Scenario::parse(xml(), "small.xml"); }

 private:
  static std::string state_of(std::string_view name, const State& state) {
    return fmt::format(
        "<{0}><position><point><x>{1}</x><y>{2}</y></point></position><orientation><exact>{3}"
        "</exact></orientation><velocity><exact>{4}</exact></velocity><time><exact>{5}</exact>"
        "</time></{0}>",
        name, state.x_m, state.y_m, state.heading_rad, state.speed_mps, state.step);
  }

  static std::string lanelet(int id, double y_m) {
    return fmt::format(
        "<lanelet id=\"{0}\"><leftBound><point><x>-100</x><y>{1}</y></point><point><x>200</x>"
        "<y>{1}</y></point></leftBound><rightBound><point><x>-100</x><y>{2}</y></point><point>"
        "<x>200</x><y>{2}</y></point></rightBound></lanelet>",
        id, y_m + 1.75, y_m - 1.75);
  }

  double ego_speed_mps_ = 10.0;
  std::string content_;
  std::string goals_;
};

}  // namespace ads::testing

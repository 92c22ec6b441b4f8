#include "messages.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <utility>

#include "common/plane.h"
#include "common/scalar.h"
#include "motion_planning_tuning.h"

namespace motion_planning {
namespace {

using ads::kInfinity;

std::vector<Eigen::Vector2d> centre_of(const hd_map::Lane& lane) {
  std::vector<Eigen::Vector2d> centre;
  const int count = std::min(lane.left().x_m_size(), lane.right().x_m_size());
  for (int index = 0; index < count; ++index) {
    centre.emplace_back(0.5 * (lane.left().x_m(index) + lane.right().x_m(index)),
                        0.5 * (lane.left().y_m(index) + lane.right().y_m(index)));
  }
  return centre;
}

double width_of(const hd_map::Lane& lane) {
  const int middle = lane.left().x_m_size() / 2;
  return std::hypot(lane.left().x_m(middle) - lane.right().x_m(middle),
                    lane.left().y_m(middle) - lane.right().y_m(middle));
}

Interval interval_of(const mission::Interval& interval) {
  return {.low = interval.low(), .high = interval.high()};
}

PredictedWay way_of(const prediction::Hypothesis& hypothesis, double age_s) {
  PredictedWay way{.probability = hypothesis.probability(), .first_s = -age_s, .states = {}};
  for (const prediction::Point& point : hypothesis.points()) {
    way.states.push_back({.x_m = point.x_m(),
                          .y_m = point.y_m(),
                          .heading_rad = point.heading_rad(),
                          .speed_mps = point.speed_mps(),
                          .along_stddev_m = point.along_stddev_m(),
                          .across_stddev_m = point.across_stddev_m()});
  }
  if (hypothesis.points_size() > 1) {
    way.step_s = hypothesis.points(1).time_s() - hypothesis.points(0).time_s();
  }
  return way;
}

bool is_finite(const PredictedWay& way) {
  return way.step_s > 0.0 && std::isfinite(way.probability) &&
         std::ranges::all_of(way.states, [](const PredictedState& state) {
           return std::isfinite(state.x_m) && std::isfinite(state.y_m) &&
                  std::isfinite(state.heading_rad) && std::isfinite(state.speed_mps) &&
                  std::isfinite(state.along_stddev_m) && std::isfinite(state.across_stddev_m);
         });
}

// A goal of lanes along which the road leads is the stretch of the road on the first of them, and
// on those that follow without a gap. Bends of the lanes are bends of the road.
void put_on_road(const mission::Goal& goal, const hd_map::Tile& tile, const Road& road,
                 Goal& known) {
  if (road.is_empty()) {
    return;
  }
  struct Part {
    double begin_m = 0.0;
    double end_m = 0.0;
    double width_m = 0.0;
    ads::Polyline centre;
  };
  std::vector<Part> parts;
  for (const hd_map::Lane& lane : tile.lanes()) {
    const std::vector<Eigen::Vector2d> points = centre_of(lane);
    if (std::ranges::find(goal.lanes(), lane.id()) == goal.lanes().end() || points.size() < 2) {
      continue;
    }
    ads::Polyline centre(points);
    const Eigen::Vector2d middle = centre.point_at(centre.length_m() / 2.0);
    const double begin_m = road.locate(points.front().x(), points.front().y()).along_m;
    const double end_m = road.locate(points.back().x(), points.back().y()).along_m;
    if (std::abs(road.locate(middle.x(), middle.y()).offset_m) < kMessages.beside_m &&
        end_m > begin_m) {
      parts.push_back({begin_m, end_m, width_of(lane), std::move(centre)});
    }
  }
  if (parts.empty()) {
    return;
  }
  std::ranges::sort(parts, {}, &Part::begin_m);
  GoalStretch stretch{.begin_m = parts.front().begin_m, .offsets_m = {}};
  double end_m = stretch.begin_m;
  for (const Part& part : parts) {
    if (part.begin_m > end_m + kMessages.gap_m) {
      break;
    }
    for (; end_m <= part.end_m; end_m += Road::kStep_m) {
      const Pose on_line = road.pose(end_m, 0.0);
      const auto at = part.centre.project({on_line.x_m, on_line.y_m});
      const Eigen::Vector2d place = part.centre.point_at(at.along_m);
      stretch.offsets_m.push_back(road.locate(place.x(), place.y()).offset_m);
    }
  }
  known.half_length_m = 0.5 * Road::kStep_m * static_cast<double>(stretch.offsets_m.size() - 1);
  known.half_width_m = parts.front().width_m / 2.0;
  known.centre = road.pose(stretch.middle_m(), stretch.offset_m(stretch.middle_m()));
  known.on_road = std::move(stretch);
}

// With room on both sides: lanes define where the road leads, not how wide it is.
Road road_along(const std::vector<const hd_map::Lane*>& lanes) {
  std::vector<RoadPoint> points;
  for (const hd_map::Lane* lane : lanes) {
    for (const Eigen::Vector2d& point : centre_of(*lane)) {
      points.push_back({.x_m = point.x(),
                        .y_m = point.y(),
                        .left_edge_m = kMessages.room_m,
                        .right_edge_m = kMessages.room_m});
    }
  }
  return Road(points);
}

planning::BindingRule::Kind kind_of(RuleKind kind) {
  switch (kind) {
    case RuleKind::kSpeedLimit:
      return planning::BindingRule::SPEED_LIMIT;
    case RuleKind::kHazard:
      return planning::BindingRule::HAZARD;
    case RuleKind::kStopLine:
      return planning::BindingRule::STOP_LINE;
    case RuleKind::kGiveWay:
      return planning::BindingRule::GIVE_WAY;
    case RuleKind::kRedLight:
      break;
  }
  return planning::BindingRule::RED_LIGHT;
}

}  // namespace

Road road_of(const hd_map::Route& route, const hd_map::Tile* tile) {
  const hd_map::Line& line = route.reference();
  std::vector<RoadPoint> points;
  for (int index = 0; index < std::min(line.x_m_size(), line.y_m_size()); ++index) {
    const auto value = [index](const auto& values, double fallback) {
      return index < values.size() ? values[index] : fallback;
    };
    points.push_back({.x_m = line.x_m(index),
                      .y_m = line.y_m(index),
                      .left_edge_m = value(route.left_edge_m(), 0.0),
                      .right_edge_m = value(route.right_edge_m(), 0.0),
                      .speed_limit_mps = value(route.speed_limit_mps(), 0.0)});
  }
  Road road(points);
  if (tile != nullptr && !road.is_empty()) {
    for (const hd_map::Lane& lane : tile->lanes()) {
      const std::vector<Eigen::Vector2d> centre = centre_of(lane);
      if (lane.type() != hd_map::CROSSING && centre.size() > 1) {
        road.add_lane(centre);
      }
    }
  }
  return road;
}

std::vector<Road> lanes_of(const hd_map::Tile& tile) {
  std::map<std::int64_t, const hd_map::Lane*> lanes;
  for (const hd_map::Lane& lane : tile.lanes()) {
    if (lane.type() != hd_map::CROSSING) {
      lanes[lane.id()] = &lane;
    }
  }
  using Chain = std::vector<const hd_map::Lane*>;
  std::vector<Chain> open;
  for (const auto& [id, lane] : lanes) {
    const bool is_first = std::ranges::none_of(
        lane->predecessors(), [&](std::int64_t before) { return lanes.contains(before); });
    if (is_first) {
      open.push_back({lane});
    }
  }
  std::vector<Road> roads;
  while (!open.empty() && roads.size() < kMessages.roads_max) {
    Chain chain = std::move(open.back());
    open.pop_back();
    bool goes_on = false;
    for (const std::int64_t after : chain.back()->successors()) {
      const auto next = lanes.find(after);
      if (next != lanes.end() && chain.size() < kMessages.lanes_max &&
          std::ranges::find(chain, next->second) == chain.end()) {
        goes_on = true;
        open.push_back(chain);
        open.back().push_back(next->second);
      }
    }
    if (!goes_on) {
      roads.push_back(road_along(chain));
    }
  }
  std::erase_if(roads, [](const Road& road) { return road.is_empty(); });
  return roads;
}

std::vector<WaitingLine> waiting_lines_of(const hd_map::Route& route, const hd_map::Tile& tile,
                                          const Road& road) {
  std::set<std::int64_t> lanes;
  for (const hd_map::Route::Section& section : route.sections()) {
    lanes.insert(section.lanes().begin(), section.lanes().end());
  }
  std::vector<WaitingLine> lines;
  for (const hd_map::Lane& lane : tile.lanes()) {
    const hd_map::Line& line = lane.stop_line();
    if (road.is_empty() || !lanes.contains(lane.id()) || line.x_m_size() < 2 ||
        line.y_m_size() < 2) {
      continue;
    }
    const RoadPlace one = road.locate(line.x_m(0), line.y_m(0));
    const RoadPlace other = road.locate(line.x_m(1), line.y_m(1));
    if (std::min(one.offset_m, other.offset_m) < kMessages.line_beside_m &&
        std::max(one.offset_m, other.offset_m) > -kMessages.line_beside_m) {
      lines.push_back({.lane = lane.id(),
                       .along_m = 0.5 * (one.along_m + other.along_m),
                       .is_stop_sign = lane.has_stop_sign()});
    }
  }
  std::ranges::sort(lines, {},
                    [](const WaitingLine& line) { return std::pair(line.along_m, line.lane); });
  return lines;
}

std::optional<double> map_end_of(const hd_map::Tile& tile, const Road& road) {
  double last_m = -kInfinity;
  bool goes_on = true;
  for (const hd_map::Lane& lane : tile.lanes()) {
    const std::vector<Eigen::Vector2d> points = centre_of(lane);
    if (road.is_empty() || lane.type() == hd_map::CROSSING || points.size() < 2) {
      continue;
    }
    const RoadPlace end = road.locate(points.back().x(), points.back().y());
    if (std::abs(end.offset_m) < kMessages.beside_m && end.along_m > last_m) {
      last_m = end.along_m;
      goes_on = !lane.successors().empty();
    }
  }
  return goes_on ? std::nullopt : std::optional(last_m);
}

std::vector<TrafficObject> objects_of(const prediction::Predictions& predictions, double age_s) {
  std::vector<TrafficObject> objects;
  for (const prediction::PredictedObject& predicted : predictions.objects()) {
    const perception::Object& object = predicted.object().object();
    TrafficObject known{.id = object.id(),
                        .length_m = object.length_m(),
                        .width_m = object.width_m(),
                        .goes_first = predicted.object().right_of_way() == scene::OBJECT_FIRST,
                        .ways = {}};
    for (const prediction::Hypothesis& hypothesis : predicted.hypotheses()) {
      known.ways.push_back(way_of(hypothesis, age_s));
    }
    std::erase_if(known.ways,
                  [](const PredictedWay& way) { return way.states.empty() || !is_finite(way); });
    const bool has_size = std::isfinite(known.length_m) && std::isfinite(known.width_m);
    if (predicted.object().is_relevant() && has_size && !known.ways.empty()) {
      objects.push_back(std::move(known));
    }
  }
  return objects;
}

std::vector<HazardArea> hazards_of(const prediction::Predictions& predictions,
                                   std::int64_t now_ns) {
  std::vector<HazardArea> hazards;
  for (const connectivity::Hazard& hazard : predictions.hazards()) {
    const bool is_over = hazard.valid_until_ns() != 0 && hazard.valid_until_ns() <= now_ns;
    if (!hazard.is_cancelled() && !is_over) {
      hazards.push_back({.x_m = hazard.x_m(),
                         .y_m = hazard.y_m(),
                         .radius_m = hazard.radius_m(),
                         .speed_mps = hazard.speed_limit_mps()});
    }
  }
  return hazards;
}

std::optional<Goal> goal_of(const mission::Goal& goal, const hd_map::Tile* tile, const Road& road,
                            const std::function<double(std::int64_t)>& seconds) {
  Goal known;
  known.half_length_m = kInfinity;
  known.half_width_m = kInfinity;
  if (goal.has_rectangle()) {
    const mission::Rectangle& rectangle = goal.rectangle();
    known.centre = {
        .x_m = rectangle.x_m(), .y_m = rectangle.y_m(), .heading_rad = rectangle.heading_rad()};
    known.half_length_m = rectangle.length_m() / 2.0;
    known.half_width_m = rectangle.width_m() / 2.0;
  } else if (goal.lanes_size() > 0 && tile != nullptr) {
    const auto lane = std::ranges::find_if(tile->lanes(), [&](const hd_map::Lane& candidate) {
      return std::ranges::find(goal.lanes(), candidate.id()) != goal.lanes().end() &&
             candidate.left().x_m_size() > 1;
    });
    if (lane == tile->lanes().end()) {
      return std::nullopt;
    }
    const ads::Polyline centre(centre_of(*lane));
    const double middle = centre.length_m() / 2.0;
    const Eigen::Vector2d place = centre.point_at(middle);
    known.centre = {.x_m = place.x(), .y_m = place.y(), .heading_rad = centre.heading_at(middle)};
    known.half_length_m = middle;
    known.half_width_m = width_of(*lane) / 2.0;
    put_on_road(goal, *tile, road, known);
  } else {
    return std::nullopt;
  }
  if (goal.has_heading_rad()) {
    known.heading_rad = interval_of(goal.heading_rad());
  }
  if (goal.has_speed_mps()) {
    known.speed_mps = interval_of(goal.speed_mps());
  }
  known.time_s = {.low = seconds(goal.window_begin_ns()), .high = seconds(goal.window_end_ns())};
  return known;
}

void write(const std::vector<BindingRule>& rules,
           google::protobuf::RepeatedPtrField<planning::BindingRule>& messages) {
  for (const BindingRule& binding : rules) {
    planning::BindingRule& message = *messages.Add();
    message.set_kind(kind_of(binding.rule.kind));
    message.set_speed_mps(binding.rule.speed_mps);
    message.set_x_m(binding.place.x_m);
    message.set_y_m(binding.place.y_m);
    message.set_ahead_m(binding.ahead_m);
    message.set_time_s(binding.time_s);
    message.set_object(binding.rule.object);
  }
}

void write(const Vehicle& vehicle, const Trajectory& trajectory, std::int64_t start_ns,
           planning::Trajectory& message) {
  message.set_start_ns(start_ns);
  for (std::size_t index = 0; index < trajectory.states.size(); ++index) {
    const State& state = trajectory.states[index];
    planning::TrajectoryPoint& point = *message.add_points();
    point.set_time_s(trajectory.step_s * static_cast<double>(index));
    point.set_x_m(state.x_m);
    point.set_y_m(state.y_m);
    point.set_heading_rad(wrapped(state.heading_rad));
    point.set_curvature_per_m(std::tan(state.steering_rad) / vehicle.wheelbase_m);
    point.set_speed_mps(state.speed_mps);
    point.set_acceleration_mps2(state.acceleration_mps2);
  }
}

}  // namespace motion_planning

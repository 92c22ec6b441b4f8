#include "hd_map.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "hd_map_tuning.h"
#include "map_file.h"

namespace ads {
namespace {

std::int64_t nanoseconds_of(fastcycle::Time time) {
  return time.time_since_epoch().count();
}

void fill(const auto& points_m, hd_map::Line& line) {
  for (const Eigen::Vector2d& point : points_m) {
    line.add_x_m(point.x());
    line.add_y_m(point.y());
  }
}

hd_map::LaneType type_of(LaneKind kind) {
  switch (kind) {
    case LaneKind::kRoad:
      return hd_map::ROAD;
    case LaneKind::kHighway:
      return hd_map::HIGHWAY;
    case LaneKind::kRamp:
      return hd_map::RAMP;
    case LaneKind::kShoulder:
      return hd_map::SHOULDER;
    case LaneKind::kCrossing:
      return hd_map::CROSSING;
    case LaneKind::kOther:
      break;
  }
  return hd_map::OTHER;
}

void fill(const LaneGraph::Node& node, hd_map::Lane& message) {
  const MapLane& lane = node.lane;
  message.set_id(lane.id);
  message.set_type(type_of(lane.kind));
  fill(lane.left_m, *message.mutable_left());
  fill(lane.right_m, *message.mutable_right());
  message.mutable_predecessors()->Add(lane.predecessors.begin(), lane.predecessors.end());
  message.mutable_successors()->Add(lane.successors.begin(), lane.successors.end());
  if (lane.left) {
    message.set_left_lane(lane.left->id);
    message.set_is_left_same_direction(lane.left->is_same_direction);
    message.set_is_left_change_forbidden(!lane.left->may_change());
  }
  if (lane.right) {
    message.set_right_lane(lane.right->id);
    message.set_is_right_same_direction(lane.right->is_same_direction);
    message.set_is_right_change_forbidden(!lane.right->may_change());
  }
  message.set_speed_limit_mps(lane.speed_limit_mps);
  message.mutable_yields_to()->Add(node.yields_to.begin(), node.yields_to.end());
  message.mutable_conflicts()->Add(node.conflicts.begin(), node.conflicts.end());
  if (lane.stop_line) {
    fill(*lane.stop_line, *message.mutable_stop_line());
  }
  message.set_has_stop_sign(lane.has_stop_sign);
  message.set_is_in_intersection(lane.is_in_intersection);
}

bool is_any_of(const std::vector<std::int64_t>& lanes, const auto& others) {
  return std::ranges::any_of(
      others, [&](std::int64_t id) { return std::ranges::find(lanes, id) != lanes.end(); });
}

void fill_sections(const LaneGraph& graph, const LanePath& path, hd_map::Route& route) {
  std::vector<std::vector<std::int64_t>> sections;
  for (const LanePath::Step& step : path.steps) {
    if (!step.is_change) {
      sections.push_back(graph.beside(step.lane));
    }
  }
  for (std::size_t index = 0; index < sections.size(); ++index) {
    const bool is_last = index + 1 == sections.size();
    auto& section = *route.add_sections();
    for (const std::int64_t id : sections[index]) {
      section.add_lanes(id);
      if (is_last ? is_any_of(path.goal_lanes, std::vector{id})
                  : is_any_of(sections[index + 1], graph.node(id).lane.successors)) {
        section.add_continuing(id);
      }
    }
  }
}

void fill_reference(const ReferenceLine& line, hd_map::Route& route) {
  fill(line.points_m, *route.mutable_reference());
  route.mutable_left_edge_m()->Add(line.left_edge_m.begin(), line.left_edge_m.end());
  route.mutable_right_edge_m()->Add(line.right_edge_m.begin(), line.right_edge_m.end());
  route.mutable_speed_limit_mps()->Add(line.speed_limit_mps.begin(), line.speed_limit_mps.end());
}

RouteGoal goal_of(const mission::Goal& message) {
  RouteGoal goal{.lanes = {message.lanes().begin(), message.lanes().end()}};
  if (message.has_rectangle()) {
    goal.place_m = Eigen::Vector2d(message.rectangle().x_m(), message.rectangle().y_m());
  }
  if (message.has_heading_rad()) {
    goal.heading_rad = (message.heading_rad().low() + message.heading_rad().high()) / 2.0;
  }
  return goal;
}

}  // namespace

HdMap::HdMap(fastcycle::Context& context)
    : Component(context),
      file_(context.param<fastcycle::Path>(
          "map", {.description = "Map file: CommonRoad, Lanelet2 or OpenDRIVE"})),
      radius_m_(
          context.param<double>("radius_m", {.fallback = 250.0,
                                             .min = 30.0,
                                             .max = kHdMap.radius_max_m,
                                             .unit = "m",
                                             .description = "Radius of the published tiles"})),
      lane_change_m_(context.param<double>(
          "lane_change_m", {.fallback = 30.0,
                            .min = 0.0,
                            .max = 10'000.0,
                            .unit = "m",
                            .description = "Length of detour that a lane change is worth"})),
      change_length_m_(context.param<double>(
          "change_length_m", {.fallback = 60.0,
                              .min = 5.0,
                              .max = 1'000.0,
                              .unit = "m",
                              .description = "Length over which the reference changes lane"})),
      extension_m_(context.param<double>(
          "extension_m",
          {.fallback = 60.0,
           .min = 30.0,
           .max = 1'000.0,
           .unit = "m",
           .description = "Length by which the reference extends beyond start and goal"})),
      smoothing_m_(context.param<double>(
          "smoothing_m",
          {.fallback = 20.0,
           .min = 1.0,
           .max = 100.0,
           .unit = "m",
           .description = "Maximum standard deviation of the smoothing of the reference"})),
      smoothing_error_m_(context.param<double>(
          "smoothing_error_m", {.fallback = 0.3,
                                .min = 0.01,
                                .max = 2.0,
                                .unit = "m",
                                .description = "Maximum shift of the reference by smoothing"})),
      tiles_(context.create_publisher<hd_map::Tile>("map/tile")),
      routes_(context.create_publisher<hd_map::Route>("map/route")) {
  context.create_subscriber<mission::InitialPose>(
      "mission/initial_pose", [this](const mission::InitialPose& pose) {
        move_to({.position_m = {pose.x_m(), pose.y_m()}, .heading_rad = pose.heading_rad()});
      });
  context.create_subscriber<localization::Ego>(
      "localization/ego", {.depth = 1}, [this](const localization::Ego& ego) {
        if (ego.quality() == localization::GOOD || ego.quality() == localization::UNCERTAIN) {
          move_to({.position_m = {ego.x_m(), ego.y_m()}, .heading_rad = ego.heading_rad()});
        }
      });
  context.create_subscriber<mission::Goal>("mission/goal", [this](const mission::Goal& goal) {
    goal_ = goal;
    publish_route();
  });
  context.create_service<hd_map::TileRequest, hd_map::Tile>(
      "map/tiles",
      [this](const hd_map::TileRequest& request, fastcycle::Responder<hd_map::Tile> responder) {
        serve_tile(request, std::move(responder));
      });
}

void HdMap::start() {
  MapFile map = read_map(file_.get());
  graph_.emplace(std::move(map.graph));
  log().info("{} lanes", graph_->nodes().size());
  if (map.origin) {
    log().info("(0, 0) is at {:.7f} N, {:.7f} E", map.origin->latitude_deg,
               map.origin->longitude_deg);
  }
  report("lanes", static_cast<std::int64_t>(graph_->nodes().size()));
}

void HdMap::move_to(const Pose& pose) {
  if (!pose.position_m.allFinite() || !std::isfinite(pose.heading_rad)) {
    return;
  }
  const bool is_first = !pose_;
  pose_ = pose;
  if (is_first) {
    publish_route();
  }
  if (!tile_at_m_ || (pose.position_m - *tile_at_m_).norm() > radius_m_.get() / 3.0) {
    publish_tile(pose.position_m);
  }
}

void HdMap::publish_tile(const Eigen::Vector2d& place_m) {
  tile_at_m_ = place_m;
  auto tile = tiles_.loan();
  fill_tile(place_m, radius_m_.get(), *tile);
  tiles_.publish(std::move(tile));
}

void HdMap::serve_tile(const hd_map::TileRequest& request,
                       fastcycle::Responder<hd_map::Tile> responder) {
  if (!std::isfinite(request.x_m()) || !std::isfinite(request.y_m()) ||
      !(request.radius_m() >= 0.0 && request.radius_m() <= kHdMap.radius_max_m)) {
    responder.reject("expected a finite place and a radius from 0 to 10 km");
    return;
  }
  auto tile = responder.loan();
  fill_tile({request.x_m(), request.y_m()}, request.radius_m(), *tile);
  responder.answer(std::move(tile));
}

void HdMap::publish_route() {
  if (!goal_ || !pose_) {
    return;
  }
  auto route = routes_.loan();
  route->mutable_header()->set_taken_ns(nanoseconds_of(now()));
  route->mutable_header()->set_frame("map");
  const auto found =
      find_path(*graph_, pose_->position_m, pose_->heading_rad, goal_of(*goal_),
                {.lane_change_m = lane_change_m_.get(), .change_length_m = change_length_m_.get()});
  if (const auto* reason = std::get_if<std::string>(&found)) {
    route->set_reason(*reason);
    log().warning("no route: {}", *reason);
  } else {
    const auto& path = std::get<LanePath>(found);
    route->set_is_found(true);
    fill_sections(*graph_, path, *route);
    fill_reference(reference_line(*graph_, path,
                                  {.change_length_m = change_length_m_.get(),
                                   .extension_m = extension_m_.get(),
                                   .smoothing_m = smoothing_m_.get(),
                                   .smoothing_error_m = smoothing_error_m_.get()}),
                   *route);
  }
  report("is_route_found", route->is_found());
  routes_.publish(std::move(route));
}

void HdMap::fill_tile(const Eigen::Vector2d& place_m, double radius_m, hd_map::Tile& tile) const {
  tile.mutable_header()->set_taken_ns(nanoseconds_of(now()));
  tile.mutable_header()->set_frame("map");
  tile.set_x_m(place_m.x());
  tile.set_y_m(place_m.y());
  tile.set_radius_m(radius_m);
  for (const std::int64_t id : graph_->within(place_m, radius_m)) {
    fill(graph_->node(id), *tile.add_lanes());
  }
}

}  // namespace ads

FASTCYCLE_COMPONENT(ads::HdMap)

#pragma once

#include <functional>
#include <vector>

#include "hd_map/map.pb.h"
#include "mission/goal.pb.h"
#include "planner.h"
#include "planning/plan.pb.h"
#include "prediction/prediction.pb.h"

namespace motion_planning {

/// Converts messages to the planner's types, and back.

/// The road along the reference of a route, with the lanes in its direction.
Road road_of(const hd_map::Route& route, const hd_map::Tile* tile);

/// Ways along single lanes: each lane without a predecessor in the tile, with its successors. Where
/// lanes diverge there is a way for each, up to a bound.
std::vector<Road> lanes_of(const hd_map::Tile& tile);

/// The stop lines of the route's lanes that the road crosses, in the order along the road.
std::vector<WaitingLine> waiting_lines_of(const hd_map::Route& route, const hd_map::Tile& tile,
                                          const Road& road);

/// Where along the road the map ends; none where it goes on, as far as the tile knows.
std::optional<double> map_end_of(const hd_map::Tile& tile, const Road& road);

/// The objects to consider; the predictions begin `age_s` ago.
std::vector<TrafficObject> objects_of(const prediction::Predictions& predictions, double age_s);

/// The areas to be careful in, without expired hazards.
std::vector<HazardArea> hazards_of(const prediction::Predictions& predictions, std::int64_t now_ns);

/// The goal, with times converted by `seconds`. A goal that names lanes is the stretch of the road
/// along them; if the road does not lead there, it is the middle of the first of them in `tile`.
std::optional<Goal> goal_of(const mission::Goal& goal, const hd_map::Tile* tile, const Road& road,
                            const std::function<double(std::int64_t)>& seconds);

void write(const std::vector<BindingRule>& rules,
           google::protobuf::RepeatedPtrField<planning::BindingRule>& messages);

void write(const Vehicle& vehicle, const Trajectory& trajectory, std::int64_t start_ns,
           planning::Trajectory& message);

}  // namespace motion_planning

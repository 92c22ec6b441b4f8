#pragma once

#include <functional>
#include <vector>

#include "hd_map/map.pb.h"
#include "mission/goal.pb.h"
#include "planner.h"
#include "planning/plan.pb.h"
#include "prediction/prediction.pb.h"

namespace motion_planning {

/// From messages to what the planner knows, and back.

/// The road along the reference of a route, with the lanes that lead in its direction.
Road road_of(const hd_map::Route& route, const hd_map::Tile* tile);

/// Ways along single lanes: each lane that has no predecessor in the tile, with its successors.
/// Where lanes part, there is a way for each, up to a bound.
std::vector<Road> lanes_of(const hd_map::Tile& tile);

/// The stop lines of the route's lanes that the road leads over, in the order in which it does.
std::vector<WaitingLine> waiting_lines_of(const hd_map::Route& route, const hd_map::Tile& tile,
                                          const Road& road);

/// The objects to be looked at; `age_s` is how long ago the predictions begin.
std::vector<TrafficObject> objects_of(const prediction::Predictions& predictions, double age_s);

/// Where to be careful; over ones are left out.
std::vector<HazardArea> hazards_of(const prediction::Predictions& predictions, std::int64_t now_ns);

/// The goal on a clock that `seconds` tells. A goal that names lanes is the stretch of the road
/// along them; if the road does not lead there, it lies in the middle of the first that `tile`
/// knows.
std::optional<Goal> goal_of(const mission::Goal& goal, const hd_map::Tile* tile, const Road& road,
                            const std::function<double(std::int64_t)>& seconds);

void write(const std::vector<BindingRule>& rules,
           google::protobuf::RepeatedPtrField<planning::BindingRule>& messages);

void write(const Vehicle& vehicle, const Trajectory& trajectory, std::int64_t start_ns,
           planning::Trajectory& message);

}  // namespace motion_planning

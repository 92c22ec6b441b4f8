#pragma once

#include <vector>

#include "common/commonroad.h"
#include "lane_graph.h"

namespace ads {

/// The lanes of a CommonRoad scenario, with right of way from its signs and intersections.
///
/// Supported signs are those of Germany (205, 206, 301, 306, also CommonRoad's Zamunda) and of the
/// USA (R1-1 stop, R1-2 yield); they stand at the lanes into an intersection and apply to those
/// through it. Priority to the right applies where an intersection defines which incoming is to the
/// left of which, and there is no traffic light.
std::vector<MapLane> lanes_of(const Scenario& scenario);

}  // namespace ads

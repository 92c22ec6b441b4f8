#pragma once

#include <vector>

#include "common/commonroad.h"
#include "lane_graph.h"

namespace ads {

/// The lanes of a CommonRoad scenario, with what its signs and intersections say of right of way.
///
/// Signs are those of Germany (205, 206, 301, 306, also CommonRoad's Zamunda) and of the USA (R1-1
/// stop, R1-2 yield); they stand at the lanes into an intersection and hold for those through it.
/// The one from the right goes first where an intersection says which way in is to the left of
/// which, and no traffic light stands there.
std::vector<MapLane> lanes_of(const Scenario& scenario);

}  // namespace ads

#pragma once

#include <cstdint>
#include <vector>

#include "common/commonroad.h"
#include "traffic.h"

namespace ads {

/// What stands beside a road and is no traffic: posts, bushes, walls. They are drawn along the
/// outer edges of the lanelets, at least `kClutterSpace_m` from any lanelet and from where any
/// obstacle of the scenario ever is. Ids are below 0. The same `seed` gives the same.
///
/// @param share  1: one at about each 12 m of an edge; 0: none.
[[nodiscard]] std::vector<Body> draw_clutter(const Scenario& scenario, double share,
                                             std::uint64_t seed);

inline constexpr double kClutterSpace_m = 0.5;

}  // namespace ads

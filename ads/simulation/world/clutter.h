#pragma once

#include <cstdint>
#include <vector>

#include "common/commonroad.h"
#include "traffic.h"

namespace ads {

/// Static objects beside a road: posts, bushes, walls. They are placed randomly along the outer
/// edges of the lanelets, at least `kClutterSpace_m` from any lanelet and from all positions of the
/// scenario's obstacles. Ids are below 0. Deterministic for a given `seed`.
///
/// @param share  1: about one for each 12 m of an edge; 0: none.
[[nodiscard]] std::vector<Body> draw_clutter(const Scenario& scenario, double share,
                                             std::uint64_t seed);

inline constexpr double kClutterSpace_m = 0.5;

}  // namespace ads

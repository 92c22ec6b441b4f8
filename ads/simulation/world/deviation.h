#pragma once

#include <cstdint>

#include "ego_model.h"

namespace ads {

/// Draws a vehicle's deviations, each uniformly within its bounds times `share`: README.md lists
/// the bounds and their sources. Deterministic for a given `seed`.
///
/// @pre  `share` is not negative; above 1 deviations may exceed their bounds.
[[nodiscard]] EgoDeviation draw_deviation(double share, std::uint64_t seed);

}  // namespace ads

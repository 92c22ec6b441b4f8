#pragma once

#include <cstdint>

#include "ego_model.h"

namespace ads {

/// A vehicle whose deviations are drawn, each evenly within its bounds times `share`: README.md has
/// the bounds and where they come from. The same `seed` gives the same vehicle.
///
/// @pre  `share` is not negative; above 1 deviations are beyond their bounds.
[[nodiscard]] EgoDeviation draw_deviation(double share, std::uint64_t seed);

}  // namespace ads

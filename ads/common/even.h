#pragma once

#include <random>

namespace ads {

/// An even draw from [0, 1). Of the distributions of the standard library only the generators give
/// the same numbers everywhere.
inline double even(std::mt19937_64& random) {
  constexpr double kSteps = 9007199254740992.0;  // 2^53: all that a double can tell apart.
  return static_cast<double>(random() >> 11U) / kSteps;
}

}  // namespace ads

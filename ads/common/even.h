#pragma once

#include <random>

namespace ads {

/// A uniform random number in [0, 1). Of the standard library's random facilities only the
/// generators give the same numbers on every platform, not the distributions.
inline double even(std::mt19937_64& random) {
  constexpr double kSteps = 9007199254740992.0;  // 2^53: the precision of a double.
  return static_cast<double>(random() >> 11U) / kSteps;
}

}  // namespace ads

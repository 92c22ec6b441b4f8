#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace ads {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

constexpr double squared(double value) {
  return value * value;
}

/// `from` where `share` is 0, `to` where it is 1.
constexpr double mix(double from, double to, double share) {
  return from + share * (to - from);
}

/// The distance from the interval [low, high]: negative below it, 0 inside, positive above it.
constexpr double outside(double value, double low, double high) {
  return value < low ? value - low : std::max(0.0, value - high);
}

/// Nanoseconds as seconds.
constexpr double seconds_of(std::int64_t ns) {
  return 1e-9 * static_cast<double>(ns);
}

}  // namespace ads

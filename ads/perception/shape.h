#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "box_view.h"

namespace ads {

/// What of an object one sweep shows, in the directions of its box.
struct Shape {
  double along_m = 0.0;
  double across_m = 0.0;
  /// At a right angle to the line of sight: what is seen of it whatever its heading is.
  double width_m = 0.0;
  double bottom_m = 0.0;
  double top_m = 0.0;
  /// Of the echoes, how many are higher than a car is.
  double high_share = 0.0;
};

[[nodiscard]] Shape shape_of(const ObjectView& view, double heading_rad);

/// What a shape looks like. Unclear is what may be a part of anything.
enum class Likeness : std::uint8_t { kUnclear, kVehicle, kTwoWheeler, kNeither };

/// Judges by measures that hold for cars, vans, and people on two wheels, whatever the sensor is:
/// they reach down to the street, are not too high, and are neither narrower nor longer than such
/// things are. Walls, hedges, trees and posts are not like that.
[[nodiscard]] Likeness likeness_of(const Shape& shape);

}  // namespace ads

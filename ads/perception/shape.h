#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "box_view.h"
#include "skyline.h"

namespace ads {

/// What of an object one sweep shows, in the directions of its box.
struct Shape {
  double along_m = 0.0;
  double across_m = 0.0;
  /// At a right angle to the line of sight: what is seen of it whatever its heading is.
  double width_m = 0.0;
  /// How much lower it would have been seen if it went on downwards: to the ground, or to what
  /// stands before it.
  double gap_m = 0.0;
  /// Something before it may hide more of it: on the right or on the left.
  bool is_cut = false;
  double top_m = 0.0;
  double range_m = 0.0;  ///< Of its nearest echo.
  /// It is flat, and what is higher than a car stands in its line beyond its ends.
  bool is_of_wall = false;
  /// It reaches up to where no beam looks higher: it may be higher than seen.
  bool is_top_open = false;
  /// Of the echoes, how many are higher than a car is.
  double high_share = 0.0;
};

/// Where things stand that are higher than a car.
///
/// @threads  Confined.
/// @realtime Allocates in its constructor only.
class HighPlaces {
 public:
  HighPlaces();

  /// @param origin_m  The echoes' places are from there.
  void fill(std::span<const Echo> echoes, const Eigen::Vector2d& origin_m);
  [[nodiscard]] bool at(const Eigen::Vector2d& place_m) const;

 private:
  [[nodiscard]] int cell_of(const Eigen::Vector2f& apart_m) const;

  Eigen::Vector2d origin_m_ = Eigen::Vector2d::Zero();
  std::vector<bool> is_high_;
  std::vector<int> filled_;
};

[[nodiscard]] Shape shape_of(const ObjectView& view, const Skyline& skyline,
                             const HighPlaces& high_places, double heading_rad);

/// What a shape looks like. Unclear is what may be a part of anything.
enum class Likeness : std::uint8_t { kUnclear, kVehicle, kVehiclePart, kTwoWheeler, kNeither };

/// Judges by measures that hold for cars, vans, and people on two wheels, whatever the sensor is:
/// they reach down to the street, are not too high, and are neither narrower nor longer than such
/// things are. Walls, hedges, trees and posts are not like that.
[[nodiscard]] Likeness likeness_of(const Shape& shape);

}  // namespace ads

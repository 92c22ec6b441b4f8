#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "box_view.h"
#include "skyline.h"

namespace ads {

/// The shape of an object as seen in one sweep, in the axes of its box.
struct Shape {
  double along_m = 0.0;
  double across_m = 0.0;
  /// Perpendicular to the line of sight: the visible width for any heading.
  double width_m = 0.0;
  /// How much farther down it would have been seen if it extended downwards: to the ground, or to
  /// what occludes it.
  double gap_m = 0.0;
  /// It may be partly occluded on the right or on the left.
  bool is_cut = false;
  double top_m = 0.0;
  double range_m = 0.0;  ///< Of its nearest return.
  /// It is flat, and continued beyond its ends by something higher than a car.
  bool is_of_wall = false;
  /// It reaches the topmost beam: it may be higher than seen.
  bool is_top_open = false;
  /// The share of its returns that are higher than a car.
  double high_share = 0.0;
};

/// A map of places with returns higher than a car.
///
/// @threads  Confined.
/// @realtime Allocates in its constructor only.
class HighPlaces {
 public:
  HighPlaces();

  /// @param origin_m  The origin of the returns' positions.
  void fill(std::span<const LidarReturn> returns, const Eigen::Vector2d& origin_m);
  [[nodiscard]] bool at(const Eigen::Vector2d& place_m) const;

 private:
  [[nodiscard]] int cell_of(const Eigen::Vector2f& apart_m) const;

  Eigen::Vector2d origin_m_ = Eigen::Vector2d::Zero();
  std::vector<bool> is_high_;
  std::vector<int> filled_;
};

[[nodiscard]] Shape shape_of(const ObjectView& view, const Skyline& skyline,
                             const HighPlaces& high_places, double heading_rad);

/// The kind of object that a shape resembles. Unclear: it may be a part of anything.
enum class Likeness : std::uint8_t { kUnclear, kVehicle, kVehiclePart, kTwoWheeler, kNeither };

/// Classifies by criteria that hold for cars, vans, and people on two wheels with any sensor: they
/// reach down to the street, are not too high, and are neither narrower nor longer than such
/// objects. Walls, hedges, trees and posts differ from that.
[[nodiscard]] Likeness likeness_of(const Shape& shape);

}  // namespace ads

#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "box_view.h"

namespace ads {

/// How far one saw in one direction, and how steeply downwards.
struct SightLine {
  float azimuth_rad = 0.0F;  ///< From the sensor's heading.
  float range_m = 0.0F;      ///< Along the ground.
  float z_m = 0.0F;          ///< Where it ends, from the sensor.
};

/// A box on the ground, in the map.
struct GroundBox {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  double length_m = 0.0;
  double width_m = 0.0;
};

/// All that was seen in a sweep, the ground as well: tells whether one sees through a box. Nobody
/// sees through the body of a car, but through most of a box around a post, a tree, or the corner
/// of a house.
///
/// @threads  Confined.
/// @realtime Allocates while lines become more.
class SightLines {
 public:
  SightLines();

  void fill(std::span<const SightLine> lines);

  /// Of the lines that meet the box at the height of a car's body, the share that ends beyond it.
  ///
  /// @param view  Of what is in the box.
  [[nodiscard]] double share_through(const ObjectView& view, const GroundBox& box) const;
  /// Whether one sees through the box, and through every other one of a likely size that holds what
  /// is seen: along or across its heading, and wherever its other end may be.
  [[nodiscard]] bool is_seen_through(const ObjectView& view, const GroundBox& box,
                                     const Eigen::Vector2d& likely_size_m) const;

 private:
  struct Line {
    float range_m;
    float slope;
  };

  [[nodiscard]] int through(const ObjectView& view, const GroundBox& box) const;

  std::vector<std::uint32_t> begin_;  // Of each direction's part of `lines_`.
  std::vector<Line> lines_;
};

}  // namespace ads

#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "box_view.h"

namespace ads {

/// The range of one beam in its direction, and its height there.
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

/// All beams of a sweep, including those that hit the ground: determines whether beams pass through
/// a box. They do not pass through the body of a car, but through most of a box around a post, a
/// tree, or the corner of a house.
///
/// @threads  Confined.
/// @realtime Allocates only while the number of lines grows.
class SightLines {
 public:
  SightLines();

  void fill(std::span<const SightLine> lines);

  /// Of the lines that meet the box at the height of a car's body, the share that ends beyond it.
  ///
  /// @param view  Of the object in the box.
  [[nodiscard]] double share_through(const ObjectView& view, const GroundBox& box) const;
  /// Whether beams pass through the box, and through every other box of a likely size that contains
  /// the returns: along or across its heading, with any position of its other end.
  [[nodiscard]] bool is_seen_through(const ObjectView& view, const GroundBox& box,
                                     const Eigen::Vector2d& likely_size_m) const;

 private:
  struct Line {
    float range_m;
    float slope;
  };

  [[nodiscard]] int through(const ObjectView& view, const GroundBox& box) const;

  std::vector<std::uint32_t> begin_;  // The begin of each direction's part of `lines_`.
  std::vector<Line> lines_;
};

}  // namespace ads

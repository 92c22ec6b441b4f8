#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "ground.h"

namespace ads {

/// A point on a border of the road, relative to the sensor, and its lateral uncertainty.
struct BorderPlace {
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
  double stddev_m = 0.0;
};

/// One line for each side, from behind to ahead; empty where no border was found.
struct RoadBorders {
  std::vector<BorderPlace> left;
  std::vector<BorderPlace> right;
};

/// An upright box that is not a border, such as a vehicle, relative to the sensor.
struct Standing {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  double length_m = 0.0;
  double width_m = 0.0;
};

/// Finds the road's edges beside the vehicle: kerbs, walls, hedges.
///
/// The plane is divided across the vehicle's axis into slices, and these into cells. From the
/// middle of each slice outwards, the road continues as long as its lowest returns rise and fall no
/// more than a road does, and nothing in a cell is higher than a step; there it ends. Points away
/// from the median of their neighbours along the road are discarded.
///
/// @threads  Confined.
/// @realtime Allocates only while the number of border points grows.
class BorderFinder {
 public:
  BorderFinder();

  /// @param standing  Returns in these boxes are ignored.
  const RoadBorders& find(std::span<const RawReturn> returns, double mount_height_m,
                          std::span<const Standing> standing);

 private:
  struct Cell {
    float lowest_m;
    float highest_m;
  };

  void fill(std::span<const RawReturn> returns, double mount_height_m,
            std::span<const Standing> standing);
  void walk(std::size_t slice, int side, std::vector<BorderPlace>& found) const;
  static std::vector<BorderPlace> smooth(const std::vector<BorderPlace>& found);

  std::vector<Cell> cells_;
  std::vector<float> level_m_;  // Of the road at mid-slice, above the ground under the sensor.
  RoadBorders borders_;
};

}  // namespace ads

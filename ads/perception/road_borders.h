#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "ground.h"

namespace ads {

/// A place on a border of the road, from the sensor, and how well it is known across.
struct BorderPlace {
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
  double stddev_m = 0.0;
};

/// One side each, from behind to ahead; empty where nothing was found.
struct RoadBorders {
  std::vector<BorderPlace> left;
  std::vector<BorderPlace> right;
};

/// An upright box that is no border: a vehicle, from the sensor.
struct Standing {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  double length_m = 0.0;
  double width_m = 0.0;
};

/// Finds where the road ends beside the vehicle: kerbs, walls, hedges.
///
/// The plane is cut across the vehicle's axis into slices, and these into cells. From the middle of
/// each slice outwards, the road goes on as long as its lowest echoes rise and fall no more than a
/// road does, and nothing in a cell stands higher than a step; there it ends. Places that lie away
/// from the median of their neighbours along the road are left out.
///
/// @threads  Confined.
/// @realtime Allocates while borders become longer.
class BorderFinder {
 public:
  BorderFinder();

  /// @param standing  Echoes in these are not looked at.
  const RoadBorders& find(std::span<const RawEcho> echoes, double mount_height_m,
                          std::span<const Standing> standing);

 private:
  struct Cell {
    float lowest_m;
    float highest_m;
  };

  void fill(std::span<const RawEcho> echoes, double mount_height_m,
            std::span<const Standing> standing);
  void walk(std::size_t slice, int side, std::vector<BorderPlace>& found) const;
  static std::vector<BorderPlace> smooth(const std::vector<BorderPlace>& found);

  std::vector<Cell> cells_;
  std::vector<float> level_m_;  // Of the road in the middle of each slice, above the sensor's foot.
  RoadBorders borders_;
};

}  // namespace ads

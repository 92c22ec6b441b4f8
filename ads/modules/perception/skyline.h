#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace ads {

/// A return that is not from the ground.
struct LidarReturn {
  /// In the map, relative to the tracker's origin, compensated for the sensor's own motion.
  Eigen::Vector2f place_m{0.0F, 0.0F};
  float height_m = 0.0F;     ///< Above the ground.
  float time_s = 0.0F;       ///< Since the begin of the sweep.
  float azimuth_rad = 0.0F;  ///< From the sensor at that time, relative to its heading.
  float range_m = 0.0F;      ///< Along the ground.
  float ground_m = 0.0F;     ///< Height of the ground there, relative to the sensor.
  bool is_of_top = false;    ///< From the topmost beam.
};

/// The free range in each direction: determines whether an object ends where its returns end, or is
/// occluded from there on.
///
/// @threads  Confined.
/// @realtime Allocates only while the number of returns grows.
class Skyline {
 public:
  Skyline();

  /// @param sensor_height_m  Above the ground.
  void fill(std::span<const LidarReturn> returns, double sensor_height_m);

  /// Whether something nearer than `range_m` lies next to the direction `azimuth_rad`, on the side
  /// of increasing azimuths (`side` = 1) or of decreasing ones (-1).
  [[nodiscard]] bool is_hidden_beside(float azimuth_rad, float range_m, int side) const;
  /// The share of the directions around `azimuth_rad` that are occluded before `range_m`.
  [[nodiscard]] double hidden_share(double azimuth_rad, double half_width_rad,
                                    double range_m) const;
  /// The height up to which an object at `range_m` is occluded; 0 if it is not.
  [[nodiscard]] float hidden_height_m(float azimuth_rad, float range_m) const;

 private:
  [[nodiscard]] std::size_t bin_of(double azimuth_rad) const;

  // An obstacle in a direction: its range, and the slope of the line of sight to it.
  struct Sight {
    float range_m;
    float slope;
  };

  std::vector<float> nearest_m_;
  std::vector<std::uint32_t> begin_;  // The begin of each direction's part of `sights_`.
  std::vector<Sight> sights_;
  float sensor_height_m_ = 0.0F;
};

}  // namespace ads

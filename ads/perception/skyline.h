#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace ads {

/// An echo that is not of the ground.
struct Echo {
  /// In the map, from the tracker's origin, where the sensor's own motion is taken out.
  Eigen::Vector2f place_m{0.0F, 0.0F};
  float height_m = 0.0F;     ///< Above the ground.
  float time_s = 0.0F;       ///< Since the begin of the sweep.
  float azimuth_rad = 0.0F;  ///< Seen from the sensor at that time, from its heading.
  float range_m = 0.0F;      ///< Along the ground.
  float ground_m = 0.0F;     ///< How high the ground is there, from the sensor.
  bool is_of_top = false;    ///< No beam looks higher.
};

/// How far one sees in each direction before something stands there: tells whether an object ends
/// where its echoes end, or is hidden from there on.
///
/// @threads  Confined.
/// @realtime Allocates while echoes become more.
class Skyline {
 public:
  Skyline();

  /// @param sensor_height_m  Above the ground.
  void fill(std::span<const Echo> echoes, double sensor_height_m);

  /// Whether something nearer than `range_m` stands beside the direction `azimuth_rad`, on the side
  /// of growing azimuths (`side` = 1) or of falling ones (-1).
  [[nodiscard]] bool is_hidden_beside(float azimuth_rad, float range_m, int side) const;
  /// The share of the directions around `azimuth_rad` in which something stands before `range_m`.
  [[nodiscard]] double hidden_share(double azimuth_rad, double half_width_rad,
                                    double range_m) const;
  /// Up to which height a thing at `range_m` is hidden by what stands before it; 0 if by nothing.
  [[nodiscard]] float hidden_height_m(float azimuth_rad, float range_m) const;

 private:
  [[nodiscard]] std::size_t bin_of(double azimuth_rad) const;

  // What stands in a direction: how far away, and how steeply one looks at it.
  struct Sight {
    float range_m;
    float slope;
  };

  std::vector<float> nearest_m_;
  std::vector<std::uint32_t> begin_;  // Of each direction's part of `sights_`.
  std::vector<Sight> sights_;
  float sensor_height_m_ = 0.0F;
};

}  // namespace ads

#pragma once

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
};

/// How far one sees in each direction before something stands there: tells whether an object ends
/// where its echoes end, or is hidden from there on.
///
/// @threads  Confined.
/// @realtime Allocates in its constructor only.
class Skyline {
 public:
  Skyline();

  void fill(std::span<const Echo> echoes);

  /// Whether something nearer than `range_m` stands beside the direction `azimuth_rad`, on the side
  /// of growing azimuths (`side` = 1) or of falling ones (-1).
  [[nodiscard]] bool is_hidden_beside(float azimuth_rad, float range_m, int side) const;
  /// The share of the directions around `azimuth_rad` in which something stands before `range_m`.
  [[nodiscard]] double hidden_share(double azimuth_rad, double half_width_rad,
                                    double range_m) const;

 private:
  [[nodiscard]] std::size_t bin_of(double azimuth_rad) const;

  std::vector<float> nearest_m_;
};

}  // namespace ads

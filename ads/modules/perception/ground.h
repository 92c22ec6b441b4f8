#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace ads {

struct GroundConfig {
  /// The maximum slope of the ground, and its maximum step from one ring to the next.
  double slope_max = 0.04;
  double step_max_m = 0.08;
  double range_max_m = 80.0;
};

/// A return in the sensor's frame.
struct RawReturn {
  float x_m = 0.0F;
  float y_m = 0.0F;
  float z_m = 0.0F;
  float time_s = 0.0F;     ///< Since the begin of the sweep.
  float range_m = 0.0F;    ///< Along the ground.
  bool is_of_top = false;  ///< From the topmost beam.
};

/// The height of the ground around the sensor.
///
/// The plane around the sensor is divided into sectors and these into bins. From the sensor
/// outwards in each sector, the lowest return of a bin belongs to the ground if it continues the
/// ground before it, neither too steep nor over a step; between such returns the ground is a
/// straight line. This is the scheme of Himmelsbach, von Hundelshausen and Wuensche, "Fast
/// Segmentation of 3D Point Clouds for Ground Vehicles" (IV 2010), with a chain in place of the
/// fitted lines.
///
/// @threads  Confined.
/// @realtime Allocates in its constructor only.
class Ground {
 public:
  explicit Ground(const GroundConfig& config);

  /// @param mount_height_m  Of the sensor, above the ground below it.
  void fit(std::span<const RawReturn> returns, double mount_height_m);

  /// The height above the ground; beyond the range, above its last bin.
  [[nodiscard]] float height_m(const RawReturn& beam_return) const;

 private:
  struct Bin {
    float lowest_z_m;
    float range_m;  // Of the lowest.
  };

  [[nodiscard]] std::size_t sector_of(const RawReturn& beam_return) const;
  [[nodiscard]] std::size_t bin_of(float range_m) const;
  void walk(std::size_t sector, float begin_z_m);

  const GroundConfig config_;
  const std::size_t bins_per_sector_;
  std::vector<Bin> bins_;
  std::vector<float> ground_z_m_;  // At the middle of each bin.
};

}  // namespace ads

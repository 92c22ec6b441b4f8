#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lidar/sweep.pb.h"
#include "noise.h"
#include "world/scene.pb.h"

namespace ads {

/// A spinning lidar on the roof. Beams do not hit the vehicle's own body.
struct LidarConfig {
  int columns = 1800;
  int rings = 64;
  double elevation_min_deg = -24.8;
  double elevation_max_deg = 2.0;
  /// Of each ring, from the lowest; empty: evenly from `elevation_min_deg` to `elevation_max_deg`.
  std::vector<double> elevations_deg = {};
  bool is_clockwise = false;  ///< Seen from above.
  /// Of the first column, from the vehicle's heading, counter-clockwise.
  double first_azimuth_deg = -150.0;
  std::int64_t turn_ns = 100'000'000;
  double range_max_m = 120.0;
  double range_stddev_m = 0.02;
  /// Fraction of beams that give no return.
  double beam_dropout = 0.01;
  double mount_forward_m = 0.0;
  double mount_height_m = 1.8;
};

/// Memory layout of one point of `lidar.Sweep`.
struct SweepPoint {
  float x_m = 0.0F;
  float y_m = 0.0F;
  float z_m = 0.0F;
  std::uint16_t time = 0;
  std::uint8_t ring = 0;
  std::uint8_t intensity = 0;
};
static_assert(sizeof(SweepPoint) == 16);

/// The lidar's view of a scene: each beam is intersected with the ground or the nearest body, at
/// the time of its column. The intersections with ground and bodies have closed forms: in the
/// vertical plane of a column, a body is a rectangle between the two points where the column enters
/// and leaves its outline (slabs: Kay and Kajiya, "Ray Tracing Complex Scenes", SIGGRAPH 1986).
///
/// @threads  Confined.
/// @realtime Allocates while the number of bodies grows.
class LidarModel {
 public:
  LidarModel(const LidarConfig& config, std::uint64_t seed);

  [[nodiscard]] const LidarConfig& config() const { return config_; }
  [[nodiscard]] std::size_t sweep_bytes() const;
  /// The time of the column, from the begin of the turn.
  [[nodiscard]] std::int64_t column_ns(int column) const;

  /// Casts the columns [`first`, `last`) of the turn that began at `turn_begin_ns` into their
  /// places in `points`. Bodies move linearly between the scenes, and stand still before and after.
  ///
  /// @pre  `points` has `sweep_bytes()`.
  void cast(const world::Scene& before, const world::Scene& after, std::int64_t turn_begin_ns,
            int first, int last, std::span<char> points);

 private:
  // From the first scene to the second: the position at `share` of it is begin + share * change.
  struct Moving {
    Eigen::Vector2d begin_m;
    Eigen::Vector2d change_m;
    double heading_rad;
    double turn_rad;
    double half_length_m;
    double half_width_m;
    double radius_m;
    double height_m;
  };
  // Where a column enters and leaves the outline of a body.
  struct Crossing {
    double enter_m;
    double leave_m;
    double height_m;
  };
  struct Ring {
    double slope;   // Tangent of the elevation.
    double cosine;  // And its cosine.
    double ground_m;
  };
  struct LidarReturn {
    double distance_m;  // Along the ground.
    bool is_body;
  };

  void prepare(const world::Scene& before, const world::Scene& after);
  void cross(const Eigen::Vector2d& sensor_m, const Eigen::Vector2d& column, double share);
  [[nodiscard]] LidarReturn meet(const Ring& ring) const;

  const LidarConfig config_;
  const NormalTable normal_;
  std::mt19937_64 random_;
  std::vector<Ring> rings_;

  Moving ego_{};
  std::vector<Moving> bodies_;
  std::vector<Crossing> crossings_;
};

/// Sets all coordinates of a sweep's points to NaN.
void spoil(std::string& points);

}  // namespace ads

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

/// A spinning lidar on the roof. The vehicle's own body is not hit.
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
  /// Share of the beams that give no echo, whatever they meet.
  double beam_dropout = 0.01;
  double mount_forward_m = 0.0;
  double mount_height_m = 1.8;
};

/// One point of `lidar.Sweep`, as its bytes lie there.
struct SweepPoint {
  float x_m = 0.0F;
  float y_m = 0.0F;
  float z_m = 0.0F;
  std::uint16_t time = 0;
  std::uint8_t ring = 0;
  std::uint8_t intensity = 0;
};
static_assert(sizeof(SweepPoint) == 16);

/// What a lidar sees of a scene: each beam meets the ground or the nearest body, at the time of its
/// column. Ground and bodies are simple enough to be met in closed form: in the vertical plane of a
/// column, a body is a rectangle between the two places where the column enters and leaves its
/// outline (slabs: Kay and Kajiya, "Ray Tracing Complex Scenes", SIGGRAPH 1986).
///
/// @threads  Confined.
/// @realtime Allocates while the number of bodies grows.
class LidarModel {
 public:
  LidarModel(const LidarConfig& config, std::uint64_t seed);

  [[nodiscard]] const LidarConfig& config() const { return config_; }
  [[nodiscard]] std::size_t sweep_bytes() const;
  /// When the column is measured, counted from the begin of the turn.
  [[nodiscard]] std::int64_t column_ns(int column) const;

  /// Casts the columns from `first` until before `last` of the turn that began at `turn_begin_ns`
  /// into their places in `points`. Between both scenes everything moves evenly, and beyond them it
  /// stands still.
  ///
  /// @pre  `points` has `sweep_bytes()`.
  void cast(const world::Scene& before, const world::Scene& after, std::int64_t turn_begin_ns,
            int first, int last, std::span<char> points);

 private:
  // From the first scene to the second: the place at `share` of it is begin + share * change.
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
  struct Echo {
    double distance_m;  // Along the ground.
    bool is_body;
  };

  void prepare(const world::Scene& before, const world::Scene& after);
  void cross(const Eigen::Vector2d& sensor_m, const Eigen::Vector2d& column, double share);
  [[nodiscard]] Echo meet(const Ring& ring) const;

  const LidarConfig config_;
  const NormalTable normal_;
  std::mt19937_64 random_;
  std::vector<Ring> rings_;

  Moving ego_{};
  std::vector<Moving> bodies_;
  std::vector<Crossing> crossings_;
};

/// Makes every coordinate of a sweep's points not a number.
void spoil(std::string& points);

}  // namespace ads

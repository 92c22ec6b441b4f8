#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>

#include "foxglove/point_cloud.pb.h"
#include "lidar/sweep.pb.h"

namespace ads {

/// The direction in which a rotating sensor scans, for clouds whose points have no timestamps.
enum class Turn : std::uint8_t {
  kNone,  ///< All points share the cloud's timestamp.
  kClockwise,
  kCounterClockwise,
};

/// Properties of the sensor that a cloud does not contain.
struct CloudConfig {
  /// From the axes of the cloud to forward, left, up.
  Eigen::Matrix3f rotation = Eigen::Matrix3f::Identity();
  /// The name of the field with the points' times; empty: the first of the usual ones.
  std::string time_field;
  /// For points without times.
  Turn turn = Turn::kNone;
  double begin_rad = 0.0;  ///< The azimuth at which a turn begins, in the cloud's axes.
  std::int64_t turn_ns = 100'000'000;
  bool is_stamp_at_end = false;
  /// The number of rings, for a sensor whose points have no ring.
  std::uint32_t rings = 64;
  /// The intensity that is mapped to 255.
  double intensity_max = 255.0;
};

/// Converts a point cloud, as published by lidar drivers, into a sweep.
///
/// The fields are found by their names: x, y, z (metres, FLOAT32 or FLOAT64); the first present of
/// time, t, timestamp, offset_time, time_stamp; of ring, channel, line, laser_id; of intensity,
/// reflectivity, i. Times are integer nanoseconds or floating-point seconds since the cloud's
/// timestamp, or UTC in FLOAT64, in seconds or nanoseconds. A point that is not finite, or at the
/// origin, is not a return.
///
/// The sweep's points keep the order of the cloud, and its columns and rings are those of the
/// sensor. The caller fills in where the sensor is mounted.
///
/// @errors  Throws `std::runtime_error`, with expected and found, if a field is missing, has
///          another type or lies outside a point, if the data are not a whole number of points, or
///          if the times are more than a second apart. `sweep` is undefined then.
void read_cloud(const foxglove::PointCloud& cloud, const CloudConfig& config, lidar::Sweep& sweep);

/// Whether the points of the cloud have their own times.
[[nodiscard]] bool has_times(const foxglove::PointCloud& cloud, const CloudConfig& config);

}  // namespace ads

#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>

#include "foxglove/point_cloud.pb.h"
#include "lidar/sweep.pb.h"

namespace ads {

/// How a sensor that turns once a cloud looks around, where its points have no times of their own.
enum class Turn : std::uint8_t {
  kNone,  ///< All points are of one moment, that of the cloud.
  kClockwise,
  kCounterClockwise,
};

/// What a cloud does not say about the sensor that it is from.
struct CloudConfig {
  /// From the axes of the cloud to forward, left, up.
  Eigen::Matrix3f rotation = Eigen::Matrix3f::Identity();
  /// The name of the field with the points' times; empty: the first that drivers usually have.
  std::string time_field;
  /// Of points without times.
  Turn turn = Turn::kNone;
  double begin_rad = 0.0;  ///< The azimuth at which a turn begins, in the cloud's axes.
  std::int64_t turn_ns = 100'000'000;
  bool is_stamp_at_end = false;
  /// Beams above each other, of a sensor whose points do not say theirs.
  std::uint32_t rings = 64;
  /// The intensity that becomes 255.
  double intensity_max = 255.0;
};

/// Makes a sweep of a cloud of points as drivers of lidars publish them.
///
/// The fields are found by their names: x, y, z (metres, FLOAT32 or FLOAT64); the first there is of
/// time, t, timestamp, offset_time, time_stamp; of ring, channel, line, laser_id; of intensity,
/// reflectivity, i. Times are nanoseconds in integers and seconds in floats since the cloud's
/// timestamp, or UTC in FLOAT64, in seconds or nanoseconds. A point that is not finite, or at the
/// origin, is no echo.
///
/// The sweep's points are in the order of the cloud, whatever that is, and it says as many columns
/// and rings as the sensor has. Where the sensor is mounted remains to be filled in.
///
/// @errors  Throws `std::runtime_error`, with expected and found, if a field is missing, of another
///          type or not within a point, if the data are no whole points, or if the times are more
///          than a second apart. `sweep` is undefined then.
void read_cloud(const foxglove::PointCloud& cloud, const CloudConfig& config, lidar::Sweep& sweep);

/// Whether the points of the cloud have times of their own.
[[nodiscard]] bool has_times(const foxglove::PointCloud& cloud, const CloudConfig& config);

}  // namespace ads

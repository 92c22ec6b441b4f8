#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace ads::velodyne {

enum class ModelKind : std::uint8_t { kVlp16, kHdl64 };

/// Direction of a laser, and the corrections of its distances.
struct Laser {
  double elevation_rad = 0.0;  ///< Above the horizontal.
  double azimuth_rad = 0.0;    ///< Subtracted from the azimuth of its block.
  double distance_m = 0.0;     ///< Added to each distance.
  double vertical_m = 0.0;     ///< Of its origin, perpendicular to the beam, upwards.
  double horizontal_m = 0.0;   ///< Of its origin, to the left.
  double height_m = 0.0;       ///< Of its origin, straight up.
  std::int64_t delay_ns = 0;   ///< From the begin of the firing.
  std::size_t ring = 0;        ///< Its rank by elevation, from the lowest.
};

/// A model of sensor, or an individual sensor.
///
/// @threads  Compatible.
struct Model {
  ModelKind kind = ModelKind::kVlp16;
  std::string name;
  std::vector<Laser> lasers;   ///< In the order of the packets.
  std::int64_t firing_ns = 0;  ///< Time between firings of all lasers.
  std::size_t firings = 0;     ///< In a packet with one return for each.
};

/// The VLP-16. Angles and vertical corrections: VLP-16 User Manual 63-9243; each laser fires 2.304
/// us after the previous one, all again after 55.296 us.
Model vlp16();

/// An HDL-64E with the lasers at their nominal angles: 32 from +2 to -8.33 degrees, 1/3 degree
/// apart, and 32 from -8.83 to -24.33, 1/2 degree apart (HDL-64E S3 User's Manual, specifications).
/// A real sensor deviates from that by degrees: use this only for simulated ones. One firing takes
/// 48 us: 1.333 million points in a second, 64 at a time.
Model nominal_hdl64();

/// An HDL-64E with the corrections of its individual calibration file, `db.xml`.
///
/// @errors  Throws `std::runtime_error` with file, expected and found.
Model read_hdl64(const std::filesystem::path& file);

}  // namespace ads::velodyne

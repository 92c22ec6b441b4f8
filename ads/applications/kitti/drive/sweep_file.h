#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace kitti {

/// One return of a recorded sweep: metres, x forward, y left, z up, from the sensor.
struct Point {
  float x_m = 0.0F;
  float y_m = 0.0F;
  float z_m = 0.0F;
  float reflectance = 0.0F;  ///< From 0 to 1.
};

/// The returns of a sweep from a file of KITTI: four little-endian floats each, compressed by xz.
///
/// @errors  Throws `std::runtime_error`, with file, place, expected and found, if the file cannot
///          be read or unpacked, ends early, is no multiple of 16 bytes, or is larger than a sweep
///          can be.
[[nodiscard]] std::vector<Point> read_sweep(const std::filesystem::path& file);

}  // namespace kitti

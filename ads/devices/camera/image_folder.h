#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace ads {

/// A picture, row by row from the upper left corner.
struct Image {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::string encoding;  ///< As `foxglove.RawImage` has it: "mono8", "mono16", "rgb8".
  std::uint32_t row_bytes = 0;
  std::string data;
};

/// Reads a PGM or PPM (`P5`, `P6`; at most 64 million pixels). Samples of two bytes become little
/// endian.
///
/// @param   name  is used in error messages
/// @errors  Throws `std::runtime_error` with name, byte, what was expected and what was found.
Image read_netpbm(const std::string& bytes, const std::string& name);

/// A picture in a folder, and the time at which it was taken.
struct ImageFile {
  std::filesystem::path path;
  std::int64_t time_ns = 0;
};

/// The files `NUMBER.pgm` and `NUMBER.ppm` of a folder by their times: the number is nanoseconds,
/// of any clock.
///
/// @errors  Throws `std::runtime_error` if there is no such folder, if it has no such file, or one
///          with another name.
std::vector<ImageFile> list_images(const std::filesystem::path& folder);

}  // namespace ads

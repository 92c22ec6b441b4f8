#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace kitti {

using Rgb = std::array<std::uint8_t, 3>;

/// A colour picture, row by row from the upper left corner.
///
/// @threads  Compatible.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb = {};

  Picture() = default;
  Picture(int its_width, int its_height)
      : width(its_width),
        height(its_height),
        rgb(std::size_t{3} * static_cast<std::size_t>(its_width) *
            static_cast<std::size_t>(its_height)) {}

  [[nodiscard]] bool has(int x, int y) const { return x >= 0 && x < width && y >= 0 && y < height; }
  /// @pre  `has(x, y)`
  [[nodiscard]] Rgb at(int x, int y) const;
  /// @pre  `has(x, y)`
  void set(int x, int y, const Rgb& color);
};

struct PictureSize {
  int width = 0;
  int height = 0;
};

/// Reads the size from the header of a PNG.
///
/// @errors  Throws `std::runtime_error`, with `name`, expected and found, if it is not a PNG, or
///          has more than 64 million pixels.
[[nodiscard]] PictureSize size_of_png(std::string_view png, const std::string& name);

/// A PNG of any kind, in colours of 8 bits.
///
/// @errors  As `size_of_png`; also if it is damaged.
[[nodiscard]] Picture decode_png(std::string_view png, const std::string& name);

/// @errors  Throws `std::runtime_error` if the picture is empty.
[[nodiscard]] std::string encode_png(const Picture& picture);

/// Draws the visible part of a line, two pixels wide. The ends may be outside of the picture.
void draw_line(Picture& picture, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
               const Rgb& color);

}  // namespace kitti

#include "applications/kitti/camera/picture.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <png.h>

namespace kitti {
namespace {

constexpr std::uint64_t kPixelsMax = 64'000'000;

/// libpng's own state, given back in any case.
class Image {
 public:
  Image() { image_.version = PNG_IMAGE_VERSION; }
  Image(const Image&) = delete;
  Image& operator=(const Image&) = delete;
  ~Image() { png_image_free(&image_); }

  png_image* operator->() { return &image_; }
  png_image* get() { return &image_; }
  [[nodiscard]] std::string message() const { return image_.message; }

 private:
  png_image image_{};
};

PictureSize begin(Image& image, std::string_view png, const std::string& name) {
  if (png_image_begin_read_from_memory(image.get(), png.data(), png.size()) == 0) {
    throw std::runtime_error(
        fmt::format("{}: expected a PNG, found {} bytes: {}", name, png.size(), image.message()));
  }
  if (std::uint64_t{image->width} * image->height > kPixelsMax) {
    throw std::runtime_error(fmt::format("{}: expected at most {} pixels, found {} x {}", name,
                                         kPixelsMax, image->width, image->height));
  }
  return {.width = static_cast<int>(image->width), .height = static_cast<int>(image->height)};
}

std::size_t index_of(const Picture& picture, int x, int y) {
  return 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
              static_cast<std::size_t>(x));
}

/// Takes from the line what lies beyond one border: `at + share * by >= 0`.
bool clip(double at, double by, double& begin, double& end) {
  if (by == 0.0) {
    return at >= 0.0;
  }
  const double share = -at / by;
  if (by > 0.0) {
    begin = std::max(begin, share);
  } else {
    end = std::min(end, share);
  }
  return begin <= end;
}

}  // namespace

Rgb Picture::at(int x, int y) const {
  const std::size_t index = index_of(*this, x, y);
  return {rgb[index], rgb[index + 1], rgb[index + 2]};
}

void Picture::set(int x, int y, const Rgb& color) {
  std::ranges::copy(color, rgb.begin() + static_cast<std::ptrdiff_t>(index_of(*this, x, y)));
}

PictureSize size_of_png(std::string_view png, const std::string& name) {
  Image image;
  return begin(image, png, name);
}

Picture decode_png(std::string_view png, const std::string& name) {
  Image image;
  const PictureSize size = begin(image, png, name);
  image->format = PNG_FORMAT_RGB;
  Picture picture(size.width, size.height);
  if (png_image_finish_read(image.get(), nullptr, picture.rgb.data(), 0, nullptr) == 0) {
    throw std::runtime_error(
        fmt::format("{}: expected a whole PNG, found {}", name, image.message()));
  }
  return picture;
}

std::string encode_png(const Picture& picture) {
  Image image;
  image->format = PNG_FORMAT_RGB;
  image->width = static_cast<png_uint_32>(picture.width);
  image->height = static_cast<png_uint_32>(picture.height);
  png_alloc_size_t size = 0;
  std::string png;
  // The first call returns the required size.
  for (const bool is_written : {false, true}) {
    if (png_image_write_to_memory(image.get(), is_written ? png.data() : nullptr, &size, 0,
                                  picture.rgb.data(), 0, nullptr) == 0) {
      throw std::runtime_error(fmt::format("a picture of {} x {}: no PNG can be made: {}",
                                           picture.width, picture.height, image.message()));
    }
    png.resize(size);
  }
  return png;
}

// Clipped as by Liang and Barsky, ACM Transactions on Graphics 3(1), 1984.
void draw_line(Picture& picture, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
               const Rgb& color) {
  const Eigen::Vector2d way = to - from;
  double begin = 0.0;
  double end = 1.0;
  if (!from.allFinite() || !to.allFinite() || !clip(from.x(), way.x(), begin, end) ||
      !clip(picture.width - 1 - from.x(), -way.x(), begin, end) ||
      !clip(from.y(), way.y(), begin, end) ||
      !clip(picture.height - 1 - from.y(), -way.y(), begin, end)) {
    return;
  }
  const Eigen::Vector2d first = from + begin * way;
  const Eigen::Vector2d inside = (end - begin) * way;
  const int steps = static_cast<int>(std::ceil(inside.cwiseAbs().maxCoeff()));
  for (int step = 0; step <= steps; ++step) {
    const Eigen::Vector2d place = first + inside * step / std::max(1, steps);
    const int x = static_cast<int>(std::lround(place.x()));
    const int y = static_cast<int>(std::lround(place.y()));
    for (const auto& [right, down] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
      if (picture.has(x + right, y + down)) {
        picture.set(x + right, y + down, color);
      }
    }
  }
}

}  // namespace kitti

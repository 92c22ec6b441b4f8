#include "image_folder.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

namespace ads {
namespace {

constexpr std::uint64_t kPixelsMax = 64'000'000;

// Numbers of the head, with white space and comments between them.
class Head {
 public:
  Head(const std::string& bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  std::uint32_t number(std::string_view what, std::uint32_t max) {
    skip();
    std::uint32_t value = 0;
    const char* const begin = bytes_.data() + at_;
    const auto read = std::from_chars(begin, bytes_.data() + bytes_.size(), value);
    if (read.ec != std::errc() || value == 0 || value > max) {
      throw std::runtime_error(fmt::format("{}: byte {}: expected the {}, 1 to {}, found \"{}\"",
                                           name_, at_, what, max, bytes_.substr(at_, 12)));
    }
    at_ += static_cast<std::size_t>(read.ptr - begin);
    return value;
  }

  // One white space ends the head.
  [[nodiscard]] std::size_t end() const { return at_ + 1; }

 private:
  void skip() {
    while (at_ < bytes_.size()) {
      if (bytes_[at_] == '#') {
        at_ = std::min(bytes_.find('\n', at_), bytes_.size());
      } else if (std::string_view(" \t\r\n").find(bytes_[at_]) == std::string_view::npos) {
        return;
      } else {
        ++at_;
      }
    }
  }

  const std::string& bytes_;
  const std::string& name_;
  std::size_t at_ = 2;
};

}  // namespace

Image read_netpbm(const std::string& bytes, const std::string& name) {
  const bool is_color = bytes.starts_with("P6");
  if (!is_color && !bytes.starts_with("P5")) {
    throw std::runtime_error(
        fmt::format("{}: byte 0: expected P5 or P6, found \"{}\"", name, bytes.substr(0, 2)));
  }
  Head head(bytes, name);
  Image image;
  image.width = head.number("width", 65'535);
  image.height = head.number("height", 65'535);
  const std::uint32_t brightest = head.number("largest sample", 65'535);
  const bool is_wide = brightest > 255;
  if (is_color && is_wide) {
    throw std::runtime_error(
        fmt::format("{}: expected colours of one byte, found samples up to {}", name, brightest));
  }
  if (std::uint64_t{image.width} * image.height > kPixelsMax) {
    throw std::runtime_error(fmt::format("{}: expected at most {} pixels, found {} x {}", name,
                                         kPixelsMax, image.width, image.height));
  }
  image.encoding = is_color ? "rgb8" : is_wide ? "mono16" : "mono8";
  image.row_bytes = image.width * (is_color ? 3 : is_wide ? 2 : 1);
  const std::size_t size = std::size_t{image.row_bytes} * image.height;
  const std::size_t found = bytes.size() - std::min(bytes.size(), head.end());
  if (found < size) {
    throw std::runtime_error(
        fmt::format("{}: byte {}: expected {} bytes of {} x {} pixels, found {}", name, head.end(),
                    size, image.width, image.height, found));
  }
  image.data = bytes.substr(head.end(), size);
  if (is_wide) {
    for (std::size_t at = 0; at + 1 < image.data.size(); at += 2) {
      std::swap(image.data[at], image.data[at + 1]);
    }
  }
  return image;
}

std::vector<ImageFile> list_images(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder)) {
    throw std::runtime_error(fmt::format("{}: expected a folder, found none", folder.string()));
  }
  std::vector<ImageFile> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::filesystem::path& path = entry.path();
    if (path.extension() != ".pgm" && path.extension() != ".ppm") {
      continue;
    }
    const std::string name = path.stem().string();
    std::int64_t time_ns = 0;
    const auto read = std::from_chars(name.data(), name.data() + name.size(), time_ns);
    if (read.ec != std::errc() || read.ptr != name.data() + name.size()) {
      throw std::runtime_error(
          fmt::format("{}: expected a name that is its time in nanoseconds, found \"{}\"",
                      path.string(), name));
    }
    files.push_back({.path = path, .time_ns = time_ns});
  }
  if (files.empty()) {
    throw std::runtime_error(
        fmt::format("{}: expected files *.pgm or *.ppm, found none", folder.string()));
  }
  std::ranges::sort(files, {}, &ImageFile::time_ns);
  return files;
}

}  // namespace ads

#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <lzma.h>
#include <unistd.h>

#include "applications/kitti/drive/sweep_file.h"

namespace kitti::testing {

/// A temporary drive folder for a test, removed on destruction. The camera looks forward from the
/// lidar's position.
class SmallDrive {
 public:
  explicit SmallDrive(const std::string& name)
      : folder_(std::filesystem::temp_directory_path() /
                ("kitti_" + name + "_" + std::to_string(::getpid()))) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_ / "velodyne");
    write("calib.txt",
          "P2: 700 0 600 0 0 700 180 0 0 0 1 0\n"
          "R0_rect: 1 0 0 0 1 0 0 0 1\n"
          "Tr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0\n");
  }
  SmallDrive(const SmallDrive&) = delete;
  SmallDrive& operator=(const SmallDrive&) = delete;
  ~SmallDrive() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] std::string configuration() const {
    return R"({"params": {"data": ")" + folder_.string() + R"("}})";
  }

  std::filesystem::path write(const std::string& file, const std::string& content) const {
    std::ofstream(folder_ / file, std::ios::binary) << content;
    return folder_ / file;
  }
  std::filesystem::path packed(const std::string& file, const std::string& content) const {
    std::string result(lzma_stream_buffer_bound(content.size()), '\0');
    std::size_t size = 0;
    if (lzma_easy_buffer_encode(1, LZMA_CHECK_CRC32, nullptr,
                                reinterpret_cast<const std::uint8_t*>(content.data()),
                                content.size(), reinterpret_cast<std::uint8_t*>(result.data()),
                                &size, result.size()) != LZMA_OK) {
      throw std::runtime_error("cannot be packed");
    }
    result.resize(size);
    return write(file, result);
  }
  std::filesystem::path sweep(int number, const std::vector<Point>& points) const {
    return packed(
        fmt::format("velodyne/{:010}.bin.xz", number),
        std::string(reinterpret_cast<const char*>(points.data()), points.size() * sizeof(Point)));
  }

 private:
  std::filesystem::path folder_;
};

}  // namespace kitti::testing

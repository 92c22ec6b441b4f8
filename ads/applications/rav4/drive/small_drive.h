#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <unistd.h>

namespace rav4::testing {

/// A temporary folder of a recorded drive for a test, removed on destruction.
///
/// Initially its streams have no rows; `begin` is the first time of all that tests write.
class SmallDrive {
 public:
  static constexpr double kBegin_s = 46'408.5;

  explicit SmallDrive(const std::string& name)
      : folder_(std::filesystem::temp_directory_path() /
                ("rav4_" + name + "_" + std::to_string(::getpid()))) {
    std::filesystem::remove_all(folder_);
    can({}, {}, {}, {});
    stream("GNSS/live_gnss_ublox", 6, {}, {});
    stream("IMU/gyro", 3, {}, {});
    stream("IMU/accelerometer", 3, {}, {});
    stream("CAN/wheel_speed", 4, {}, {});
    stream("CAN/steering_angle", 1, {}, {});
    reference({}, {});
  }
  SmallDrive(const SmallDrive&) = delete;
  SmallDrive& operator=(const SmallDrive&) = delete;
  ~SmallDrive() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// The configuration of a component that reads the drive.
  [[nodiscard]] std::string configuration() const {
    return R"({"params": {"data": ")" + folder_.string() + R"("}})";
  }

  /// `times_s` count from `kBegin_s`, here and below; `payloads` have 8 bytes each.
  void can(const std::vector<double>& times_s, const std::vector<std::int64_t>& addresses,
           const std::vector<std::int64_t>& buses, const std::vector<std::string>& payloads) const {
    write_times("processed_log/CAN/raw_can/t.npy", times_s);
    write("processed_log/CAN/raw_can/address.npy", "<i8", shape(addresses.size()),
          bytes(addresses));
    write("processed_log/CAN/raw_can/src.npy", "<i8", shape(buses.size()), bytes(buses));
    std::string all;
    for (const std::string& payload : payloads) {
      all += payload;
    }
    write("processed_log/CAN/raw_can/data.npy", "|S8", shape(payloads.size()), all);
  }

  void stream(const std::string& name, std::size_t columns, const std::vector<double>& times_s,
              const std::vector<double>& values) const {
    write_times("processed_log/" + name + "/t.npy", times_s);
    write("processed_log/" + name + "/value.npy", "<f8", shape(times_s.size(), columns),
          bytes(values));
  }

  void reference(const std::vector<double>& times_s, const std::vector<double>& ecef_m) const {
    write_times("global_pose/frame_times.npy", times_s);
    write("global_pose/frame_positions.npy", "<f8", shape(times_s.size(), 3), bytes(ecef_m));
  }

  /// Truncates a file of the drive.
  void truncate(const std::string& file) const {
    const auto path = folder_ / file;
    std::filesystem::resize_file(path, std::filesystem::file_size(path) - 1);
  }

 private:
  static std::string shape(std::size_t rows) { return "(" + std::to_string(rows) + ",)"; }
  static std::string shape(std::size_t rows, std::size_t columns) {
    return "(" + std::to_string(rows) + ", " + std::to_string(columns) + ")";
  }

  template <typename Number>
  static std::string bytes(const std::vector<Number>& numbers) {
    std::string text(numbers.size() * sizeof(Number), '\0');
    if (!numbers.empty()) {
      std::memcpy(text.data(), numbers.data(), text.size());
    }
    return text;
  }

  void write_times(const std::string& file, std::vector<double> times_s) const {
    for (double& time_s : times_s) {
      time_s += kBegin_s;
    }
    write(file, "<f8", shape(times_s.size()), bytes(times_s));
  }

  void write(const std::string& file, const std::string& type, const std::string& shape,
             const std::string& content) const {
    const std::string header =
        "{'descr': '" + type + "', 'fortran_order': False, 'shape': " + shape + ", }\n";
    const auto path = folder_ / file;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream stream(path, std::ios::binary);
    stream << "\x93NUMPY" << '\x01' << '\0' << static_cast<char>(header.size() % 256)
           << static_cast<char>(header.size() / 256) << header << content;
  }

  std::filesystem::path folder_;
};

}  // namespace rav4::testing

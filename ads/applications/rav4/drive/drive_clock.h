#pragma once

#include <filesystem>

#include <fastcycle/fastcycle.h>

namespace rav4 {

/// Converts the times of a recorded drive to the application's time, in the same way for all
/// readers of the drive: the first row of the sensor streams (CAN, GNSS, IMU) is at the
/// application's start, and all others are later by their recorded interval.
///
/// @threads  Compatible.
class DriveClock {
 public:
  /// @param first_time_s  The recorded time at which the drive begins.
  explicit DriveClock(double first_time_s) : first_time_s_(first_time_s) {}

  /// Finds the beginning in the folder `data` of a drive.
  ///
  /// @errors  Throws `std::runtime_error` if a sensor stream cannot be read, or if all are empty.
  static DriveClock read(const std::filesystem::path& data);

  /// The recorded time `time_s` relative to the application's start; negative before the first
  /// sensor row. Rounded to nanoseconds.
  ///
  /// @errors  Throws `std::runtime_error` for a time that is not finite or a year or more away.
  [[nodiscard]] fastcycle::Duration offset_of(double time_s) const;

 private:
  double first_time_s_;
};

}  // namespace rav4

#pragma once

#include <filesystem>

#include <fastcycle/fastcycle.h>

namespace rav4 {

/// The one rule by which the times of a recorded drive become times of the application, the same
/// for everybody who reads the drive: the first row of the sensor streams (CAN, GNSS, IMU) comes
/// when the application starts, and all else as much later as it was recorded.
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

  /// How long after the application's start the recorded time `time_s` is; negative for what was
  /// before the first sensor row. Rounded to nanoseconds.
  ///
  /// @errors  Throws `std::runtime_error` for a time that is not finite or a year or more away.
  [[nodiscard]] fastcycle::Duration offset_of(double time_s) const;

 private:
  double first_time_s_;
};

}  // namespace rav4

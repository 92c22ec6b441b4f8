#include "applications/rav4/drive/drive_clock.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "common/npy.h"

namespace rav4 {

DriveClock DriveClock::read(const std::filesystem::path& data) {
  double first_time_s = std::numeric_limits<double>::infinity();
  for (const char* const stream :
       {"CAN/raw_can", "GNSS/live_gnss_ublox", "IMU/gyro", "IMU/accelerometer"}) {
    const ads::NumberTable times =
        ads::read_npy_numbers(data / "processed_log" / stream / "t.npy", 1);
    if (times.rows() > 0) {
      first_time_s = std::min(first_time_s, times.at(0, 0));
    }
  }
  if (!std::isfinite(first_time_s)) {
    throw std::runtime_error(fmt::format(
        "{}: expected rows with a time in CAN, GNSS or IMU, found none", data.string()));
  }
  return DriveClock(first_time_s);
}

fastcycle::Duration DriveClock::offset_of(double time_s) const {
  constexpr double kYear_s = 365.0 * 86'400.0;
  const double offset_s = time_s - first_time_s_;
  if (!(std::abs(offset_s) < kYear_s)) {
    throw std::runtime_error(
        fmt::format("expected a time within a year of the drive's first, {} s, found {} s",
                    first_time_s_, time_s));
  }
  return fastcycle::Duration(std::llround(offset_s * 1e9));
}

}  // namespace rav4

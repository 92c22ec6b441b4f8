#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "common/npy.h"
#include "rav4/drive/drive_clock.h"

namespace rav4 {

/// Compares values that were decoded here with those that came decoded with the drive, row by row.
///
/// @threads  Confined.
class DecodeCheck {
 public:
  DecodeCheck(std::vector<fastcycle::Duration> offsets, ads::NumberTable values)
      : offsets_(std::move(offsets)), values_(std::move(values)) {}

  /// Reads the stream in `folder`, with its `t` and `value` of so many columns.
  static DecodeCheck read(const DriveClock& clock, const std::filesystem::path& folder,
                          std::size_t columns);

  /// Compares `values` with the row of the time `offset`, which is the same to a microsecond. Calls
  /// come in the order of time.
  void compare(fastcycle::Duration offset, std::span<const double> values);

  [[nodiscard]] std::int64_t compared() const { return compared_; }
  /// Messages that had no row, and rows before the last message that had none.
  [[nodiscard]] std::int64_t unmatched() const { return unmatched_; }
  /// The largest difference of any value so far.
  [[nodiscard]] double max_error() const { return max_error_; }

 private:
  std::vector<fastcycle::Duration> offsets_;
  ads::NumberTable values_;
  std::size_t next_ = 0;
  std::int64_t compared_ = 0;
  std::int64_t unmatched_ = 0;
  double max_error_ = 0.0;
};

}  // namespace rav4

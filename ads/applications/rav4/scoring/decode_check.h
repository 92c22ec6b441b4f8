#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "applications/rav4/drive/drive_clock.h"
#include "common/npy.h"

namespace rav4 {

/// Compares values decoded here with the decoded values that come with the drive, row by row.
///
/// @threads  Confined.
class DecodeCheck {
 public:
  DecodeCheck(std::vector<fastcycle::Duration> offsets, ads::NumberTable values)
      : offsets_(std::move(offsets)), values_(std::move(values)) {}

  /// Reads the stream in `folder`, with its `t` and its `value` of `columns` columns.
  static DecodeCheck read(const DriveClock& clock, const std::filesystem::path& folder,
                          std::size_t columns);

  /// Compares `values` with the row at the time `offset`, equal within a microsecond. Call it in
  /// the order of time.
  void compare(fastcycle::Duration offset, std::span<const double> values);

  [[nodiscard]] std::int64_t compared() const { return compared_; }
  /// Messages without a row, and rows before the last message without a message.
  [[nodiscard]] std::int64_t unmatched() const { return unmatched_; }
  /// The largest difference so far.
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

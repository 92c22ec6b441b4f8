#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "applications/rav4/drive/drive_clock.h"

namespace rav4 {

/// The due times of the rows of one recorded stream, in order.
///
///     while (const auto row = playback.take_due(now() - start_time())) { publish(*row); }
///
/// @threads  Confined.
/// @realtime No allocation after construction.
class Playback {
 public:
  /// @errors  Throws `std::runtime_error`, with `name`, if times are not finite or decrease.
  Playback(const DriveClock& clock, const std::vector<double>& times_s, std::string_view name);

  /// Reads the times `t.npy` of the stream in `folder`.
  static Playback read(const DriveClock& clock, const std::filesystem::path& folder);

  struct Row {
    std::size_t index = 0;
    fastcycle::Duration offset{};  ///< Since the application's start.
  };

  /// The next row, if it is due at `elapsed` since the application's start; each row once.
  [[nodiscard]] std::optional<Row> take_due(fastcycle::Duration elapsed);

  /// When the next row is due; none if all have been taken.
  [[nodiscard]] std::optional<fastcycle::Duration> next_due() const;

  [[nodiscard]] std::size_t rows() const { return offsets_.size(); }

 private:
  std::vector<fastcycle::Duration> offsets_;
  std::size_t next_ = 0;
};

/// The earlier of two due times, each of which may be none.
[[nodiscard]] std::optional<fastcycle::Duration> earlier(
    const std::optional<fastcycle::Duration>& a, const std::optional<fastcycle::Duration>& b);

/// The time as the headers of messages contain it.
[[nodiscard]] inline std::int64_t nanoseconds_of(fastcycle::Time time) {
  return time.time_since_epoch().count();
}

}  // namespace rav4

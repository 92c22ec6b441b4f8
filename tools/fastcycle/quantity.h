#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace fastcycle::tool {

/// `12.3 MB`: a number of bytes for display, in powers of ten.
[[nodiscard]] std::string bytes_text(std::uint64_t bytes);

/// A size as people write it: `100MB`, `64KiB`, `1.5GB`, `4096B`. None if it is not above zero, or
/// not a size.
[[nodiscard]] std::optional<std::uint64_t> parse_bytes(std::string_view text);

/// A time in a log, counted from its beginning, in nanoseconds: `10s`, `500ms`, and `0s`, which is
/// not a duration. None if it is not a time.
[[nodiscard]] std::optional<std::uint64_t> parse_offset(std::string_view text);

/// `2026-11-21T18:01:14.000000007Z`: nanoseconds since 1970 as time of day, UTC.
[[nodiscard]] std::string utc_text(std::uint64_t time_ns);

/// `12.345 s`, with nanoseconds where there are any below the microsecond.
[[nodiscard]] std::string seconds_text(std::uint64_t duration_ns);

}  // namespace fastcycle::tool

#pragma once

#include <cstdint>

#include <fmt/format.h>

#include "base/clock.h"
#include "ros2/cdr.h"

namespace fastcycle::dds_gateway {

/// The latest time allowed in messages between applications, in nanoseconds since 1970: sums and
/// differences of such times fit into 64 bits.
inline constexpr std::int64_t kWireTimeMax_ns = std::int64_t{1} << 62U;

/// Reads a time of a message between applications.
///
/// @errors  `ros2::CdrError` if it is before 1970, or after `kWireTimeMax_ns`.
inline Time read_wire_time(ros2::CdrReader& in, const char* field) {
  const auto time_ns = in.number<std::int64_t>(field);
  if (time_ns < 0 || time_ns > kWireTimeMax_ns) {
    in.fail(field, fmt::format("nanoseconds from 0 to {}", kWireTimeMax_ns),
            fmt::format("{}", time_ns));
  }
  return base::from_ns(time_ns);
}

}  // namespace fastcycle::dds_gateway

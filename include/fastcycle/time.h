#pragma once

#include <chrono>

namespace fastcycle {

/// A point in time of the application's clock, in nanoseconds since 1970-01-01 UTC.
///
/// With the clock `live` it runs as the machine's monotonic clock does and never steps; its offset
/// to Unix time is fixed when the application starts. With the clock `simulated` it begins at
/// `kSimulatedStart` and moves from cause to cause.
using Time = std::chrono::sys_time<std::chrono::nanoseconds>;

/// A span of time in nanoseconds.
using Duration = std::chrono::nanoseconds;

/// Where simulated time begins: 2000-01-01 00:00:00 UTC, the same in every run.
inline constexpr Time kSimulatedStart{std::chrono::seconds{946'684'800}};

}  // namespace fastcycle

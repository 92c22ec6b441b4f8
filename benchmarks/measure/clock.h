#pragma once

#include <cerrno>
#include <cstdint>
#include <ctime>

namespace fastcycle::measure {

/// CLOCK_MONOTONIC in nanoseconds: the clock of all stamps.
[[nodiscard]] inline std::int64_t now_ns() noexcept {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
}

/// Sleeps until `deadline_ns` on CLOCK_MONOTONIC; returns immediately if that has passed.
inline void sleep_until(std::int64_t deadline_ns) noexcept {
  timespec time{};
  time.tv_sec = deadline_ns / 1'000'000'000;
  time.tv_nsec = deadline_ns % 1'000'000'000;
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
  }
}

}  // namespace fastcycle::measure

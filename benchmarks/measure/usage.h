#pragma once

#include <cstdint>

namespace fastcycle::measure {

/// Resource usage of the process since its start (getrusage).
struct Usage {
  double cpu_us = 0;
  std::int64_t minor_faults = 0;
  std::int64_t major_faults = 0;
  std::int64_t voluntary_switches = 0;
  std::int64_t involuntary_switches = 0;

  [[nodiscard]] static Usage now() noexcept;
  [[nodiscard]] Usage operator-(const Usage& earlier) const noexcept;
  Usage& operator+=(const Usage& more) noexcept;
};

}  // namespace fastcycle::measure

#include "measure/usage.h"

#include <sys/resource.h>

namespace fastcycle::measure {

Usage Usage::now() noexcept {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto to_us = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) * 1e6 + static_cast<double>(time.tv_usec);
  };
  return {.cpu_us = to_us(used.ru_utime) + to_us(used.ru_stime),
          .minor_faults = used.ru_minflt,
          .major_faults = used.ru_majflt,
          .voluntary_switches = used.ru_nvcsw,
          .involuntary_switches = used.ru_nivcsw};
}

Usage Usage::operator-(const Usage& earlier) const noexcept {
  return {.cpu_us = cpu_us - earlier.cpu_us,
          .minor_faults = minor_faults - earlier.minor_faults,
          .major_faults = major_faults - earlier.major_faults,
          .voluntary_switches = voluntary_switches - earlier.voluntary_switches,
          .involuntary_switches = involuntary_switches - earlier.involuntary_switches};
}

Usage& Usage::operator+=(const Usage& more) noexcept {
  cpu_us += more.cpu_us;
  minor_faults += more.minor_faults;
  major_faults += more.major_faults;
  voluntary_switches += more.voluntary_switches;
  involuntary_switches += more.involuntary_switches;
  return *this;
}

}  // namespace fastcycle::measure

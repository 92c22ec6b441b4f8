#include "inspect/pause.h"

#include <algorithm>

namespace fastcycle::inspect {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

namespace {

constexpr nanoseconds kShortestInterval = milliseconds(4);
constexpr nanoseconds kBehindMax = milliseconds(2);

}  // namespace

nanoseconds wait_for_pause(nanoseconds interval, nanoseconds age, nanoseconds period) noexcept {
  const bool is_steady = age >= nanoseconds(0) && age <= interval;
  if (!is_steady || interval < kShortestInterval || interval > 4 * period) {
    return period;
  }
  const nanoseconds behind = std::min(interval / 4, kBehindMax);
  const nanoseconds least = period + age - behind;
  const auto intervals = (least + interval - nanoseconds(1)) / interval;
  return intervals * interval + behind - age;
}

}  // namespace fastcycle::inspect

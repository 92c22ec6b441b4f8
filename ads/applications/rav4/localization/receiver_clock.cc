#include "receiver_clock.h"

#include <algorithm>
#include <cmath>

namespace rav4 {
namespace {

// No fix comes so late or early by transport alone: then it was the clock that jumped.
constexpr double kJump_s = 0.5;

}  // namespace

std::chrono::nanoseconds ReceiverClock::lateness(std::chrono::nanoseconds arrival, double utc_ms) {
  if (!std::isfinite(utc_ms)) {
    return {};
  }
  // Differences to the first fix are small numbers: no digit is lost.
  const double arrival_s = std::chrono::duration<double>(arrival - first_arrival_).count();
  const double offset_s = arrival_s - (utc_ms - first_utc_ms_) * 1e-3;
  if (count_ == 0 || !(std::abs(offset_s - mean_s_) < kJump_s)) {
    count_ = 1;
    first_utc_ms_ = utc_ms;
    first_arrival_ = arrival;
    mean_s_ = 0.0;
    return {};
  }
  count_ = std::min(count_ + 1, kMemory);
  mean_s_ += (offset_s - mean_s_) / static_cast<double>(count_);
  return std::chrono::nanoseconds(std::llround((offset_s - mean_s_) * 1e9));
}

}  // namespace rav4

#include "actuators.h"

namespace ads {
namespace {

// Some seconds of commands, more than any delay needs.
constexpr std::size_t kWaitingMax = 1024;

}  // namespace

void Actuators::take(double time_s, const Command& command) {
  if (waiting_.size() == kWaitingMax) {
    waiting_.pop_front();
  }
  waiting_.push_back({.time_s = time_s, .command = command});
}

EgoDemand Actuators::demand_at(double time_s, const EgoState& state) {
  // Times are sums of decimal fractions: half a microsecond is no delay.
  constexpr double kSameTime = 5e-7;
  while (!waiting_.empty() && waiting_.front().time_s + options_.delay_s <= time_s + kSameTime) {
    current_ = waiting_.front().command;
    current_time_s_ = waiting_.front().time_s;
    waiting_.pop_front();
  }
  is_timed_out_ = current_.is_autonomous &&
                  time_s > current_time_s_ + options_.delay_s + options_.timeout_s + kSameTime;
  if (is_timed_out_) {
    return {.steering_rad = state.steering_rad,
            .acceleration_mps2 = -options_.timeout_braking_mps2};
  }
  return current_.is_autonomous ? current_.demand : EgoDemand{};
}

}  // namespace ads

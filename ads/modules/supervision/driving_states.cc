#include "driving_states.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace ads {

std::string_view to_string(DrivingState state) {
  switch (state) {
    case DrivingState::kOff:
      return "off";
    case DrivingState::kAvailable:
      return "available";
    case DrivingState::kEngaged:
      return "engaged";
    case DrivingState::kEngagedDegraded:
      return "degraded";
    case DrivingState::kMinimalRiskStop:
      return "minimal-risk stop";
    case DrivingState::kStopped:
      return "stopped";
  }
  return "off";
}

supervision::DrivingState message_of(DrivingState state) {
  return static_cast<supervision::DrivingState>(state);
}
static_assert(static_cast<int>(DrivingState::kEngaged) == supervision::ENGAGED);
static_assert(static_cast<int>(DrivingState::kStopped) == supervision::STOPPED);

DrivingState driving_state_of(supervision::DrivingState state) {
  return static_cast<DrivingState>(state);
}

bool is_autonomous(DrivingState state) {
  return state != DrivingState::kOff && state != DrivingState::kAvailable;
}

std::string DrivingStates::find_missing(const Observation& observation) {
  if (!observation.failures.empty()) {
    return observation.failures.front();
  }
  for (const Watched& input : observation.inputs) {
    if (std::isinf(input.age_s)) {
      return fmt::format("{} has never come", input.what);
    }
    if (!(input.age_s <= input.limit_s)) {
      return fmt::format("{} is {:.0f} ms old, more than {:.0f}", input.what, input.age_s * 1e3,
                         input.limit_s * 1e3);
    }
  }
  return {};
}

bool DrivingStates::go_to(DrivingState state, std::string reason, double time_s) {
  reason_ = std::move(reason);
  if (state == state_) {
    return false;
  }
  state_ = state;
  since_s_ = time_s;
  return true;
}

bool DrivingStates::look_while_off(const Observation& observation, const std::string& missing) {
  if (!missing.empty()) {
    return go_to(DrivingState::kOff, missing, observation.time_s);
  }
  if (!observation.engage_at_s) {
    return go_to(DrivingState::kAvailable, "nobody has asked for it yet", observation.time_s);
  }
  if (observation.time_s < *observation.engage_at_s) {
    return go_to(DrivingState::kAvailable, "it is not time yet", observation.time_s);
  }
  weak_until_s_ = observation.time_s;
  return go_to(DrivingState::kEngaged, {}, observation.time_s);
}

bool DrivingStates::look_while_engaged(const Observation& observation, const std::string& missing) {
  if (!missing.empty()) {
    standing_since_s_.reset();
    return go_to(DrivingState::kMinimalRiskStop, missing, observation.time_s);
  }
  if (!observation.weaknesses.empty()) {
    weak_until_s_ = observation.time_s + limits_.recovery_s;
    return go_to(DrivingState::kEngagedDegraded, observation.weaknesses.front(),
                 observation.time_s);
  }
  if (observation.time_s < weak_until_s_) {
    return false;
  }
  return go_to(DrivingState::kEngaged, {}, observation.time_s);
}

bool DrivingStates::take_over(supervision::TakeoverCause cause, std::string reason, double time_s) {
  if (!is_autonomous(state_)) {
    return false;
  }
  takeover_ = cause;
  standing_since_s_.reset();
  return go_to(DrivingState::kOff, std::move(reason), time_s);
}

bool DrivingStates::look_at(const Observation& observation) {
  switch (state_) {
    case DrivingState::kOff:
    case DrivingState::kAvailable:
      if (takeover_ != supervision::TAKEOVER_NONE) {
        return false;
      }
      return look_while_off(observation, find_missing(observation));
    case DrivingState::kEngaged:
    case DrivingState::kEngagedDegraded:
      return look_while_engaged(observation, find_missing(observation));
    case DrivingState::kMinimalRiskStop:
      if (!(std::abs(observation.speed_mps) < limits_.standing_mps)) {
        standing_since_s_.reset();
        return false;
      }
      standing_since_s_ = standing_since_s_.value_or(observation.time_s);
      return observation.time_s - *standing_since_s_ >= limits_.standing_s &&
             go_to(DrivingState::kStopped, reason_, observation.time_s);
    case DrivingState::kStopped:
      return false;
  }
  return false;
}

void DrivingStates::save(supervision::DrivingMemory& memory) const {
  memory.set_state(message_of(state_));
  memory.set_reason(reason_);
  memory.set_since_s(since_s_);
  memory.set_weak_until_s(weak_until_s_);
  memory.set_takeover(takeover_);
  if (standing_since_s_) {
    memory.set_standing_since_s(*standing_since_s_);
  }
}

void DrivingStates::load(const supervision::DrivingMemory& memory) {
  state_ = driving_state_of(memory.state());
  reason_ = memory.reason();
  since_s_ = memory.since_s();
  weak_until_s_ = memory.weak_until_s();
  takeover_ = memory.takeover();
  standing_since_s_ =
      memory.has_standing_since_s() ? std::optional(memory.standing_since_s()) : std::nullopt;
}

}  // namespace ads

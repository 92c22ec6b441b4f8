#include "component/words.h"

namespace fastcycle::host {

using detail::ComponentState;

const char* to_word(ComponentState state) noexcept {
  switch (state) {
    case ComponentState::kDeclared:
      return "declared";
    case ComponentState::kConstructed:
      return "constructed";
    case ComponentState::kStandby:
      return "standby";
    case ComponentState::kActive:
      return "active";
    case ComponentState::kRestarting:
      return "restarting";
    case ComponentState::kStopped:
      return "stopped";
    case ComponentState::kFailed:
      return "failed";
  }
  return "?";
}

const char* to_word(Health health) noexcept {
  switch (health) {
    case Health::kOk:
      return "ok";
    case Health::kDegraded:
      return "degraded";
    case Health::kFailed:
      return "failed";
  }
  return "?";
}

const char* to_word(detail::Subscription::Kind kind) noexcept {
  switch (kind) {
    case detail::Subscription::Kind::kCallback:
      return "callback";
    case detail::Subscription::Kind::kLatest:
      return "latest";
    case detail::Subscription::Kind::kHistory:
      return "history";
    case detail::Subscription::Kind::kSynchronized:
      return "synchronized";
    case detail::Subscription::Kind::kTap:
      return "tap";
  }
  return "?";
}

}  // namespace fastcycle::host

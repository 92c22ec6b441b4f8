#include "host/words.h"

namespace fastcycle::host {

using detail::ComponentCore;

const char* to_word(ComponentCore::State state) noexcept {
  switch (state) {
    case ComponentCore::State::kDeclared:
      return "declared";
    case ComponentCore::State::kConstructed:
      return "constructed";
    case ComponentCore::State::kStandby:
      return "standby";
    case ComponentCore::State::kActive:
      return "active";
    case ComponentCore::State::kRestarting:
      return "restarting";
    case ComponentCore::State::kStopped:
      return "stopped";
    case ComponentCore::State::kFailed:
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

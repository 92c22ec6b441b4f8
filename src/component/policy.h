#pragma once

#include "base/thread.h"
#include "config/description.h"

namespace fastcycle::host {

[[nodiscard]] inline base::SchedulingPolicy to_policy(config::Policy policy) {
  switch (policy) {
    case config::Policy::kFifo:
      return base::SchedulingPolicy::kFifo;
    case config::Policy::kRr:
      return base::SchedulingPolicy::kRoundRobin;
    case config::Policy::kOther:
      break;
  }
  return base::SchedulingPolicy::kOther;
}

}  // namespace fastcycle::host

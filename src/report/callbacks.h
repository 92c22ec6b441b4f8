#pragma once

#include <map>
#include <string>
#include <vector>

#include "base/histogram.h"
#include "host/application.h"

namespace fastcycle::host {

/// One callback of a component, and how long it takes.
struct KnownCallback {
  std::string name;  ///< The topic; of a call its service; of a timer what it is for.
  std::string kind;  ///< What calls it: "message", "tick", "request", "reply", …
  const base::CoarseHistogram* run_time = nullptr;  ///< Lives as long as the application.
};

/// The callbacks that there are or were, by component: of subscriptions in the order of their
/// topics, then of timers in that of their declaration.
///
/// @threads  Safe, between `Application::build` and the application's end.
[[nodiscard]] std::map<std::string, std::vector<KnownCallback>> find_callbacks(
    const Application& application);

}  // namespace fastcycle::host

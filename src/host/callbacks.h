#pragma once

#include <map>
#include <string>
#include <vector>

#include "base/histogram.h"
#include "broker/topics.h"
#include "component/component_host.h"

namespace fastcycle::host {

/// A callback of a component and its run time.
struct KnownCallback {
  std::string name;  ///< The topic; of a call its service; of a timer its purpose.
  std::string kind;  ///< Its cause: "message", "tick", "request", "reply", …
  const base::CoarseHistogram* run_time = nullptr;  ///< Valid as long as the application.
};

/// All present and past callbacks, by component: of subscriptions in the order of their topics,
/// then of timers in the order of their declaration.
///
/// Call in `Application::look_at_topics`.
///
/// @threads  Safe, between `Application::build` and the application's end.
[[nodiscard]] std::map<std::string, std::vector<KnownCallback>> find_callbacks(
    const detail::Topics& topics, const Components& components);

}  // namespace fastcycle::host

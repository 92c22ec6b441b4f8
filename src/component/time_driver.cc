#include "component/time_driver.h"

#include <algorithm>

namespace fastcycle::host {

bool needs_pool(const config::ApplicationDescription& application) {
  return std::ranges::any_of(application.components,
                             [](const auto& component) { return component.executor.empty(); });
}

std::vector<std::string> executor_names(const config::ApplicationDescription& application) {
  std::vector<std::string> names;
  for (const config::ExecutorDescription& executor : application.executors) {
    names.push_back(executor.name);
  }
  if (needs_pool(application)) {
    names.emplace_back(kPoolName);
  }
  return names;
}

}  // namespace fastcycle::host

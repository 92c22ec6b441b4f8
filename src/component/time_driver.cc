#include "component/time_driver.h"

#include <algorithm>
#include <thread>

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

unsigned pool_size() {
  return std::clamp(std::thread::hardware_concurrency(), 1U, 64U);
}

unsigned simulated_worker_count(unsigned asked) {
  return asked == 0 ? std::max(1U, std::thread::hardware_concurrency()) : asked;
}

unsigned worker_count(const config::ApplicationDescription& application) {
  unsigned count = needs_pool(application) ? pool_size() : 0;
  for (const config::ExecutorDescription& executor : application.executors) {
    count += static_cast<unsigned>(executor.threads);
  }
  return count;
}

}  // namespace fastcycle::host

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

std::vector<std::string> worker_names(const config::ApplicationDescription& application) {
  std::vector<std::string> names;
  const auto add = [&names](const std::string& executor, unsigned count) {
    for (unsigned worker = 0; worker < count; ++worker) {
      names.push_back(count == 1 ? executor : executor + "-" + std::to_string(worker));
    }
  };
  for (const config::ExecutorDescription& executor : application.executors) {
    add(executor.name, static_cast<unsigned>(executor.threads));
  }
  if (needs_pool(application)) {
    add(kPoolName, pool_size());
  }
  return names;
}

unsigned worker_count(const config::ApplicationDescription& application) {
  return static_cast<unsigned>(worker_names(application).size());
}

}  // namespace fastcycle::host

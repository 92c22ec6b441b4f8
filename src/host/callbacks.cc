#include "host/callbacks.h"

#include "component/component_core.h"
#include "component/service_topics.h"
#include "executor/activation_ring.h"

namespace fastcycle::host {
namespace {

KnownCallback callback_of(const detail::CallbackSubscription& subscription) {
  const std::string& topic = subscription.topic.name;
  const auto mark = topic.find(detail::kServiceMark);
  if (mark == std::string::npos) {
    return {.name = topic,
            .kind = detail::to_word(subscription.cause),
            .run_time = &subscription.run_time};
  }
  // "double#request", "double#reply/client", "double#feedback/client".
  return {.name = topic.substr(0, mark),
          .kind = topic.substr(mark + 1, topic.find('/', mark) - mark - 1),
          .run_time = &subscription.run_time};
}

}  // namespace

std::map<std::string, std::vector<KnownCallback>> find_callbacks(const detail::Topics& topics,
                                                                 const Components& components) {
  std::map<std::string, std::vector<KnownCallback>> found;
  for (const auto& [name, topic] : topics.all()) {
    for (const auto& subscription : topic->subscriptions) {
      if (subscription->is_called()) {
        found[subscription->component].push_back(
            callback_of(static_cast<const detail::CallbackSubscription&>(*subscription)));
      }
    }
  }
  for (const auto& component : components) {
    for (const detail::TimerStatistics* timer : component->timer_statistics()) {
      found[component->name].push_back({.name = timer->name,
                                        .kind = detail::to_word(timer->cause),
                                        .run_time = &timer->run_time});
    }
  }
  return found;
}

}  // namespace fastcycle::host

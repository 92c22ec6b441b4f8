#include "host/application_wiring.h"

#include "calls/server_core.h"
#include "host/application.h"

namespace fastcycle::host {

ApplicationWiring wiring_of(const Application& application) {
  ApplicationWiring wiring;
  for (const auto& [name, topic] : application.topics().all()) {
    for (const auto& publisher : topic->publishers) {
      wiring.publishers.push_back(
          {.topic = name,
           .type = topic->type,
           .component = publisher->owner.name,
           .latched = publisher->options.latched,
           .credits = publisher->credits() == nullptr ? 0 : publisher->credits()->window,
           .is_external = publisher->options.is_external});
    }
    for (const auto& subscription : topic->subscriptions) {
      if (subscription->kind != detail::Subscription::Kind::kTap) {
        wiring.subscriptions.push_back(
            {.topic = name,
             .type = topic->type,
             .component = subscription->component,
             .is_called = subscription->is_called(),
             .drops_newest = subscription->overflow == Overflow::kDropNewest,
             .depth = subscription->depth,
             .keep = subscription->keep});
      }
    }
  }
  for (const auto& component : application.components()) {
    if (component->is_recorder) {
      wiring.recorders.push_back(component->name);
    }
    for (const auto& server : component->servers) {
      wiring.services.push_back(detail::ServerCore::of(*server).service);
    }
  }
  return wiring;
}

}  // namespace fastcycle::host

#include "component/credits.h"

#include <algorithm>
#include <string>
#include <utility>

#include "component/component_core.h"
#include "fastcycle/component.h"

namespace fastcycle {

namespace detail {

void use_credits(ComponentCore& core, PublisherCore& publisher, std::size_t window,
                 std::function<void()> on_credits) {
  publisher.use_credits(window);
  if (!on_credits) {
    return;
  }
  const auto complain = [&](const std::string& what, const std::string& hint) {
    core.problems->add(config::make_error(core.description.place,
                                          "component \"" + core.name + "\": its publisher on \"" +
                                              publisher.topic.name + "\" " + what,
                                          hint));
  };
  if (publisher.credits() == nullptr) {
    complain("has on_credits, but no credits", "say PublisherOptions::credits, or \"topics\": {\"" +
                                                   publisher.topic.name + "\": {\"credits\": 8}}");
  } else if (publisher.options.is_external) {
    complain("is external, and has on_credits",
             "a thread waits by ExternalPublisher::wait_for_credit");
  } else {
    if (!core.is_redeclaring) {
      publisher.credits()->set_inbox(core.inbox);
    }
    core.on_credits(publisher, std::move(on_credits));
  }
}

}  // namespace detail

namespace host {

void check_credits(const Components& components, const detail::Topics& topics,
                   config::Problems& problems) {
  const auto complain = [&](const detail::Subscription& subscription, std::size_t window) {
    for (const auto& component : components) {
      if (component->name == subscription.component) {
        const std::string depth = std::to_string(subscription.depth);
        const std::string credits = std::to_string(window);
        config::Problem problem = config::make_error(
            component->description.place,
            "component \"" + component->name + "\" lets " + depth + " messages of topic \"" +
                subscription.topic.name + "\" wait, fewer than its " + credits + " credits",
            "a depth of " + credits + ", or " + depth + " credits");
        problem.expected = "at least " + credits;
        problem.found = depth;
        problems.add(std::move(problem));
      }
    }
  };
  for (const auto& [name, topic] : topics.all()) {
    std::size_t window = 0;
    for (const auto& publisher : topic->publishers) {
      window = std::max(window, publisher->credits() == nullptr ? 0 : publisher->credits()->window);
    }
    for (const auto& subscription : topic->subscriptions) {
      if (subscription->is_called() && subscription->depth < window) {
        complain(*subscription, window);
      }
    }
  }
}

}  // namespace host
}  // namespace fastcycle

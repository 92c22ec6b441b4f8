#include "host/build_checks.h"

#include <chrono>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "component/component_core.h"
#include "component/own_names.h"
#include "component/service_topics.h"
#include "config/nearest.h"

namespace fastcycle::host {

namespace {

config::Place place_of(const config::ApplicationDescription& application, const std::string& name) {
  for (const config::ComponentDescription& component : application.components) {
    if (component.name == name) {
      return component.place;
    }
  }
  return application.place;
}

}  // namespace

void check_own_topics(const Components& components, config::Problems& problems) {
  for (const auto& component : components) {
    for (const detail::PublisherCore* publisher : component->declared.publishers) {
      if (publisher->topic.name.starts_with(kOwnTopics) && component->name != kOwnName) {
        problems.add(config::make_error(component->description.place,
                                        "component \"" + component->name + "\" publishes on \"" +
                                            publisher->topic.name + "\", but what begins with \"" +
                                            kOwnTopics + "\" only FastCycle itself publishes"));
      }
    }
  }
}

void check_topics(const config::ApplicationDescription& description, const detail::Topics& topics,
                  config::Problems& problems) {
  std::vector<std::string> published;
  for (const auto& [name, topic] : topics.all()) {
    if (!topic->publishers.empty()) {
      published.push_back(name);
    }
  }
  for (const detail::TopicConflict& conflict : topics.conflicts()) {
    if (conflict.kind == detail::TopicConflict::Kind::kNoPublisher && !problems.keeps_warnings()) {
      continue;
    }
    config::Problem problem;
    problem.place = place_of(description, conflict.component);
    const std::string topic = "topic \"" + conflict.topic + "\"";
    switch (conflict.kind) {
      case detail::TopicConflict::Kind::kTwoTypes:
        problem.expected = conflict.other_type;
        problem.found = conflict.type;
        problem.message = topic + " has two types: component \"" + conflict.component +
                          "\" uses it as " + conflict.type + ", component \"" + conflict.other +
                          "\" as " + conflict.other_type;
        break;
      case detail::TopicConflict::Kind::kTwoPublishers:
        problem.expected = "one publisher";
        problem.found = "\"" + conflict.other + "\" and \"" + conflict.component + "\"";
        problem.message = topic + " has two publishers, \"" + conflict.other + "\" and \"" +
                          conflict.component + "\"";
        problem.hint = "if that is meant, say \"topics\": {\"" + conflict.topic +
                       "\": {\"multiple_publishers\": true}}";
        break;
      case detail::TopicConflict::Kind::kNoPublisher:
        if (conflict.topic.find(detail::kServiceMark) != std::string::npos) {
          continue;  // A service without a server or client, which is reported as such.
        }
        problem.message = topic + ", which component \"" + conflict.component +
                          "\" subscribes to, is published by nobody";
        problem.hint = config::did_you_mean(config::nearest(conflict.topic, published));
        problem.warning = true;
        break;
    }
    problems.add(std::move(problem));
  }
  for (const config::TopicDescription& topic : description.topics) {
    const detail::Topic* known = topics.find(topic.name);
    if (known != nullptr && known->publishers.empty() && known->subscriptions.empty()) {
      config::Problem problem =
          config::make_error(topic.place, "topic \"" + topic.name + "\" is used by no component",
                             config::did_you_mean(config::nearest(topic.name, published)));
      problem.warning = true;
      problems.add(std::move(problem));
    }
  }
}

void check_quality(const config::ApplicationDescription& description, const Components& components,
                   config::Problems& problems) {
  const auto in_ms = [](Duration span) {
    return fmt::format("{} ms", std::chrono::duration<double, std::milli>(span).count());
  };
  for (const auto& component : components) {
    for (const auto& offered : component->offered) {
      const detail::Topic& topic = offered->publisher.topic;
      for (const auto& subscription : topic.subscriptions) {
        const auto asked =
            subscription->quality == nullptr ? std::nullopt : subscription->quality->deadline();
        if (!asked || *asked >= offered->period()) {
          continue;
        }
        config::Problem problem;
        problem.place = place_of(description, subscription->component);
        problem.expected = "at least " + in_ms(offered->period());
        problem.found = in_ms(*asked);
        problem.message = "component \"" + subscription->component + "\" wants a message of \"" +
                          topic.name + "\" every " + in_ms(*asked) + ", component \"" +
                          component->name + "\" promises one only every " +
                          in_ms(offered->period());
        problem.warning = true;
        problems.add(std::move(problem));
      }
    }
  }
}

}  // namespace fastcycle::host

#include "host/application_wiring.h"

#include <stdexcept>

#include <nlohmann/json.hpp>

#include "calls/server_core.h"
#include "host/application.h"

namespace fastcycle::host {

using nlohmann::json;

ApplicationWiring wiring_of(const Application& application) {
  ApplicationWiring wiring;
  for (const auto& [name, topic] : application.topics().all()) {
    for (const auto& publisher : topic->publishers) {
      wiring.publishers.push_back({.topic = name,
                                   .type = topic->type,
                                   .component = publisher->owner.name,
                                   .latched = publisher->options.latched});
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

std::string to_text(const ApplicationWiring& wiring) {
  json publishers = json::array();
  for (const auto& one : wiring.publishers) {
    publishers.push_back({{"topic", one.topic},
                          {"type", one.type},
                          {"component", one.component},
                          {"latched", one.latched}});
  }
  json subscriptions = json::array();
  for (const auto& one : wiring.subscriptions) {
    subscriptions.push_back({{"topic", one.topic},
                             {"type", one.type},
                             {"component", one.component},
                             {"is_called", one.is_called},
                             {"drops_newest", one.drops_newest},
                             {"depth", one.depth},
                             {"keep", one.keep}});
  }
  return json{{"publishers", publishers},
              {"subscriptions", subscriptions},
              {"services", wiring.services},
              {"recorders", wiring.recorders}}
      .dump(-1, ' ', false, json::error_handler_t::replace);
}

ApplicationWiring wiring_from_text(const std::string& text) {
  ApplicationWiring wiring;
  try {
    const json said = json::parse(text);
    for (const json& one : said.at("publishers")) {
      wiring.publishers.push_back({.topic = one.at("topic"),
                                   .type = one.at("type"),
                                   .component = one.at("component"),
                                   .latched = one.at("latched")});
    }
    for (const json& one : said.at("subscriptions")) {
      wiring.subscriptions.push_back({.topic = one.at("topic"),
                                      .type = one.at("type"),
                                      .component = one.at("component"),
                                      .is_called = one.at("is_called"),
                                      .drops_newest = one.at("drops_newest"),
                                      .depth = one.at("depth"),
                                      .keep = one.at("keep")});
    }
    wiring.services = said.at("services").get<std::vector<std::string>>();
    wiring.recorders = said.at("recorders").get<std::vector<std::string>>();
  } catch (const json::exception& exception) {
    throw std::runtime_error(std::string("the wiring of the application cannot be read: ") +
                             exception.what());
  }
  return wiring;
}

}  // namespace fastcycle::host

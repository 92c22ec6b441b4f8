#include "host/declared_wiring.h"

#include <stdexcept>

#include <nlohmann/json.hpp>

namespace fastcycle::host {

std::string to_text(const ApplicationWiring& wiring) {
  nlohmann::json publishers = nlohmann::json::array();
  for (const auto& one : wiring.publishers) {
    publishers.push_back({{"topic", one.topic},
                          {"type", one.type},
                          {"component", one.component},
                          {"latched", one.latched},
                          {"credits", one.credits},
                          {"is_external", one.is_external}});
  }
  nlohmann::json subscriptions = nlohmann::json::array();
  for (const auto& one : wiring.subscriptions) {
    subscriptions.push_back({{"topic", one.topic},
                             {"type", one.type},
                             {"component", one.component},
                             {"is_called", one.is_called},
                             {"drops_newest", one.drops_newest},
                             {"depth", one.depth},
                             {"keep", one.keep}});
  }
  return nlohmann::json{{"publishers", publishers},
                        {"subscriptions", subscriptions},
                        {"services", wiring.services},
                        {"recorders", wiring.recorders}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

ApplicationWiring wiring_from_text(const std::string& text) {
  ApplicationWiring wiring;
  try {
    const nlohmann::json said = nlohmann::json::parse(text);
    for (const nlohmann::json& one : said.at("publishers")) {
      wiring.publishers.push_back({.topic = one.at("topic"),
                                   .type = one.at("type"),
                                   .component = one.at("component"),
                                   .latched = one.at("latched"),
                                   .credits = one.at("credits"),
                                   .is_external = one.at("is_external")});
    }
    for (const nlohmann::json& one : said.at("subscriptions")) {
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
  } catch (const nlohmann::json::exception& exception) {
    throw std::runtime_error(std::string("the wiring of the application cannot be read: ") +
                             exception.what());
  }
  return wiring;
}

}  // namespace fastcycle::host

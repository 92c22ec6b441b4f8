#include "estimate/text.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "estimate/duration_text.h"

namespace fastcycle::estimate {
namespace {

using nlohmann::ordered_json;

double milliseconds(Duration span) {
  return std::chrono::duration<double, std::milli>(span).count();
}

ordered_json json_of(const std::optional<Duration>& span) {
  return span ? ordered_json(milliseconds(*span)) : ordered_json();
}

ordered_json json_of(const System& system, const Hop& hop) {
  const Callback& callback = system.callbacks[hop.callback];
  const Component& component = system.components[callback.component];
  auto hindrances = ordered_json::array();
  for (const Hindrance& hindrance : hop.hindrances) {
    hindrances.push_back({{"component", system.components[hindrance.component].name},
                          {"ms", milliseconds(hindrance.time)}});
  }
  return {{"component", component.name},
          {"callback", callback.name},
          {"executor", system.executors[component.executor].name},
          {"held_ms", milliseconds(hop.held)},
          {"waiting_ms", milliseconds(hop.waiting)},
          {"running_ms", milliseconds(hop.running)},
          {"waits_for", std::move(hindrances)}};
}

std::string hops_text(const System& system, const ChainEstimate& chain) {
  std::string text = fmt::format("  {:<32} {:>10} {:>10} {:>10}   waits for\n", "hop", "held",
                                 "waiting", "running");
  for (const Hop& hop : chain.hops) {
    const Callback& callback = system.callbacks[hop.callback];
    std::string waits_for;
    for (const Hindrance& hindrance : hop.hindrances) {
      if (waits_for.size() > 40) {
        break;
      }
      waits_for += (waits_for.empty() ? "" : ", ") + system.components[hindrance.component].name +
                   " " + text_of(hindrance.time);
    }
    std::string name = system.components[callback.component].name + ": " + callback.name;
    text += fmt::format("  {:<32} {:>10} {:>10} {:>10}   {}\n", name, text_of(hop.held),
                        text_of(hop.waiting),
                        &hop == &chain.hops.back() ? "-" : text_of(hop.running), waits_for);
  }
  return text;
}

}  // namespace

std::string to_text(const System& system, const Estimate& estimate) {
  std::string text;
  for (std::size_t i = 0; i < system.executors.size(); ++i) {
    const Executor& executor = system.executors[i];
    text += fmt::format("executor {}: {} worker{}, {:.0f} % busy at most\n", executor.name,
                        executor.threads, executor.threads == 1 ? "" : "s",
                        100 * estimate.executors[i] / executor.threads);
  }
  for (std::size_t i = 0; i < system.chains.size(); ++i) {
    const Chain& chain = system.chains[i];
    const ChainEstimate& its = estimate.chains[i];
    text += fmt::format("chain {} ({} → {}): {}{}, deadline {}\n", chain.name,
                        system.topics[chain.from], system.topics[chain.to], to_word(its.verdict),
                        its.bound ? "; at most " + text_of(*its.bound) : "; no bound",
                        text_of(chain.deadline));
    if (!its.hops.empty() && its.bound) {
      text += hops_text(system, its);
    }
    for (const std::string& reason : its.reasons) {
      text += "  why: " + reason + "\n";
    }
    for (const std::string& remedy : its.remedies) {
      text += "  " + remedy + "\n";
    }
  }
  return text;
}

std::string to_json(const System& system, const Estimate& estimate) {
  ordered_json json;
  json["wake_up_us"] = static_cast<double>(system.wake_up.count()) / 1e3;
  json["executors"] = ordered_json::array();
  for (std::size_t i = 0; i < system.executors.size(); ++i) {
    json["executors"].push_back({{"name", system.executors[i].name},
                                 {"threads", system.executors[i].threads},
                                 {"utilization", estimate.executors[i]}});
  }
  json["components"] = ordered_json::array();
  for (std::size_t i = 0; i < system.components.size(); ++i) {
    json["components"].push_back(
        {{"name", system.components[i].name},
         {"executor", system.executors[system.components[i].executor].name},
         {"utilization", estimate.components[i].utilization},
         {"response_ms", json_of(estimate.components[i].response)}});
  }
  json["chains"] = ordered_json::array();
  for (std::size_t i = 0; i < system.chains.size(); ++i) {
    const Chain& chain = system.chains[i];
    const ChainEstimate& its = estimate.chains[i];
    auto hops = ordered_json::array();
    for (const Hop& hop : its.hops) {
      hops.push_back(json_of(system, hop));
    }
    json["chains"].push_back({{"name", chain.name},
                              {"from", system.topics[chain.from]},
                              {"to", system.topics[chain.to]},
                              {"verdict", to_word(its.verdict)},
                              {"bound_ms", json_of(its.bound)},
                              {"deadline_ms", milliseconds(chain.deadline)},
                              {"running_ms", milliseconds(its.running)},
                              {"hops", std::move(hops)},
                              {"reasons", its.reasons},
                              {"remedies", its.remedies}});
  }
  return json.dump(2);
}

}  // namespace fastcycle::estimate

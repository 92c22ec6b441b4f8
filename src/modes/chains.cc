#include "modes/chains.h"

#include <algorithm>
#include <array>
#include <set>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "broker/topics.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "component/wiring.h"
#include "config/nearest.h"
#include "modes/modes.h"

namespace fastcycle::host {

using config::ChainDescription;
using detail::ChainEnd;
using detail::Subscription;
using detail::Topic;

namespace {

double ms(Duration span) {
  return std::chrono::duration<double, std::milli>(span).count();
}

/// The graph of subscribers and what they publish.
class Ways {
 public:
  explicit Ways(const detail::Topics& topics) {
    for (const auto& [name, topic] : topics.all()) {
      if (!topic->publishers.empty()) {
        published_.push_back(name);
      }
      for (const auto& subscription : topic->subscriptions) {
        if (subscription->kind != Subscription::Kind::kTap) {
          subscribers_[name].insert(subscription->component);
        }
      }
      for (const auto& publisher : topic->publishers) {
        publishes_[publisher->owner.name].insert(name);
        if (publisher->brings_trails()) {
          brought_.insert(name);
        }
      }
    }
  }

  [[nodiscard]] const std::vector<std::string>& published() const { return published_; }
  [[nodiscard]] std::vector<std::string> subscribed() const {
    std::vector<std::string> names;
    for (const auto& [name, components] : subscribers_) {
      names.push_back(name);
    }
    return names;
  }

  /// The topics from other applications, where chains may have begun.
  [[nodiscard]] const std::set<std::string>& brought() const { return brought_; }
  /// These, and the topics they reach.
  [[nodiscard]] std::set<std::string> beyond_brought() const {
    std::set<std::string> reached = brought_;
    for (const std::string& topic : brought_) {
      reached.merge(beyond(topic));
    }
    return reached;
  }
  /// The topics that `from` reaches.
  [[nodiscard]] std::set<std::string> beyond(const std::string& from) const {
    std::set<std::string> reached;
    std::vector<std::string> left{from};
    while (!left.empty()) {
      const std::string topic = std::move(left.back());
      left.pop_back();
      const auto subscribers = subscribers_.find(topic);
      if (subscribers == subscribers_.end()) {
        continue;
      }
      for (const std::string& component : subscribers->second) {
        const auto published = publishes_.find(component);
        if (published == publishes_.end()) {
          continue;
        }
        for (const std::string& next : published->second) {
          if (reached.insert(next).second) {
            left.push_back(next);
          }
        }
      }
    }
    return reached;
  }

 private:
  std::vector<std::string> published_;
  std::map<std::string, std::set<std::string>> subscribers_;
  std::map<std::string, std::set<std::string>> publishes_;
  std::set<std::string> brought_;
};

config::Place place_of(const config::ApplicationDescription& application,
                       const ChainDescription& chain, const char* key) {
  for (const config::Value& value : application.effective["chains"].items()) {
    if (value.place() == chain.place && value.find(key) != nullptr) {
      return value.find(key)->place();
    }
  }
  return chain.place;
}

nlohmann::ordered_json json_of(const base::HistogramSummary& summary) {
  const auto us = [](double ns) { return ns / 1e3; };
  return {{"p50", us(summary.p50)}, {"p99", us(summary.p99)}, {"max", us(summary.max)}};
}

nlohmann::ordered_json topic_of(const HopReport& hop) {
  return hop.topic.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(hop.topic);
}

}  // namespace

const HopReport* ChainReport::largest_contributor() const {
  const auto most = std::ranges::max_element(hops, {}, &HopReport::breaches);
  return most == hops.end() || most->breaches() == 0 ? nullptr : &*most;
}

nlohmann::ordered_json to_json(const std::vector<ChainReport>& chains) {
  auto json = nlohmann::ordered_json::array();
  for (const ChainReport& chain : chains) {
    auto hops = nlohmann::ordered_json::array();
    for (const HopReport& hop : chain.hops) {
      const bool is_last = hop.topic.empty();  // The receiver, which publishes nothing of it.
      hops.push_back({{"component", hop.component},
                      {"topic", topic_of(hop)},
                      {"count", hop.waiting.count},
                      {"waiting_us", json_of(hop.waiting)},
                      {"running_us", is_last ? nlohmann::ordered_json() : json_of(hop.running)},
                      {"breaches", hop.breaches()}});
    }
    nlohmann::ordered_json largest;
    if (const HopReport* hop = chain.largest_contributor()) {
      largest = nlohmann::ordered_json{{"component", hop->component},
                                       {"topic", topic_of(*hop)},
                                       {"part", hop->larger_part()},
                                       {"breaches", hop->breaches()}};
    }
    json.push_back({{"name", chain.name},
                    {"from", chain.from},
                    {"to", chain.to},
                    {"deadline_ms", chain.deadline_ms},
                    {"on_breach", config::to_string(chain.on_breach)},
                    {"judged", chain.is_judged},
                    {"count", chain.count},
                    {"breaches", chain.breaches},
                    {"dropped", chain.dropped},
                    {"age_us", json_of(chain.age)},
                    {"hops", std::move(hops)},
                    {"largest_contributor", std::move(largest)}});
  }
  return json;
}

void Chains::declare(detail::Topics& topics) {
  std::map<std::string, std::vector<detail::ChainRule>> ends;
  const auto& chains = application_.description().chains;
  for (std::size_t i = 0; i < chains.size(); ++i) {
    auto root = std::ranges::find(roots_, chains[i].from);
    if (root == roots_.end()) {
      root = roots_.insert(roots_.end(), chains[i].from);
    }
    ends[chains[i].to].push_back({.chain = i,
                                  .root = static_cast<std::size_t>(root - roots_.begin()),
                                  .deadline = chains[i].deadline,
                                  .drops = chains[i].on_breach == config::OnBreach::kDrop});
  }
  topics.set_chains(roots_, std::move(ends));
}

void Chains::check(config::Problems& problems) {
  const config::ApplicationDescription& description = application_.description();
  if (description.chains.empty()) {
    return;
  }
  const Ways ways(wiring_.topics());
  const std::vector<std::string> subscribed = ways.subscribed();
  const bool is_replay = application_.is_replay();
  for (std::size_t i = 0; i < description.chains.size(); ++i) {
    const ChainDescription& chain = description.chains[i];
    const std::string its = "the chain \"" + chain.name + "\" ";
    const auto add = [&](const char* key, const std::string& what, std::string hint) {
      if (is_replay && !not_judged_.insert(i).second) {
        return;
      }
      config::Problem problem =
          config::make_error(place_of(description, chain, key), its + what, std::move(hint));
      if (is_replay) {
        // The application as a whole was checked before: the cause is components that do not run.
        problem.warning = true;
        problem.message = its + "is not checked in this replay: it " + what;
        problem.hint.clear();
      }
      problems.add(std::move(problem));
    };
    const Topic* from = wiring_.topics().find(chain.from);
    const bool is_published = from != nullptr && !from->publishers.empty();
    const bool begins_elsewhere = !is_published && !ways.brought().empty();
    if (!is_published && !begins_elsewhere) {
      add("from", "begins at \"" + chain.from + "\", which nobody publishes",
          config::did_you_mean(config::nearest(chain.from, ways.published())));
    } else if (is_published && !from->ages()) {
      add("from", "begins at \"" + chain.from + "\", whose messages do not grow old",
          "the topic is latched, or its \"ages\" is false");
    }
    const bool is_subscribed = std::ranges::find(subscribed, chain.to) != subscribed.end();
    if (!is_subscribed) {
      add("to", "ends at \"" + chain.to + "\", to which nobody subscribes: nobody is late",
          config::did_you_mean(config::nearest(chain.to, subscribed)));
    }
    if ((!is_published && !begins_elsewhere) || !is_subscribed) {
      continue;
    }
    std::set<std::string> reached = ways.beyond(chain.from);
    reached.merge(ways.beyond_brought());  // It may have returned from another application.
    if (!reached.contains(chain.to)) {
      std::string names;
      for (const std::string& name : reached) {
        names += (names.empty() ? "" : ", ") + name;
      }
      add("to", "ends at \"" + chain.to + "\", which nothing of \"" + chain.from + "\" reaches",
          names.empty() ? "no component that subscribes to it publishes anything"
                        : "it reaches " + names);
    }
  }
}

void Chains::breached(detail::ComponentCore& sink, std::size_t chain) {
  const ChainDescription& its = application_.description().chains[chain];
  if (its.on_breach == config::OnBreach::kDegrade && !modes_.is_asked(its.mode)) {
    modes_.ask_in_turn(
        its.mode,
        fmt::format("the chain \"{}\" took longer than {} ms", its.name, ms(its.deadline)), sink);
  }
}

/// If several components subscribe to its end, the sum of their results.
ChainReport Chains::report_of(const detail::Topics& topics, std::size_t chain) const {
  struct Sum {
    std::size_t place = 0;
    HopReport report;
    base::Histogram waiting;
    base::Histogram running;
  };
  const ChainDescription& its = application_.description().chains[chain];
  ChainReport report{.name = its.name,
                     .from = its.from,
                     .to = its.to,
                     .deadline_ms = ms(its.deadline),
                     .on_breach = its.on_breach,
                     .is_judged = !not_judged_.contains(chain)};
  const Topic* to = topics.find(its.to);
  if (to == nullptr) {
    return report;
  }
  base::Histogram age;
  std::map<std::pair<std::string, std::string>, Sum> sums;  // By component and topic.
  for (const auto& subscription : to->subscriptions) {
    if (subscription->chain_end == nullptr) {
      continue;
    }
    for (const auto& end : subscription->chain_end->chains()) {
      if (end->rule.chain != chain) {
        continue;
      }
      age.merge(end->age);
      report.breaches += end->breaches.get();
      report.dropped += end->dropped.get();
      const std::size_t count = end->hop_count.load(std::memory_order_acquire);
      for (std::size_t i = 0; i < count; ++i) {
        const ChainEnd::HopStatistics& hop = end->hops[i];
        HopReport named{.component = subscription->component};
        if (auto names = topics.names().find(hop.publisher.load())) {
          named.component = std::move(names->component);
          named.topic = std::move(names->topic);
        }
        Sum& sum = sums[{named.component, named.topic}];
        sum.place = std::max(sum.place, hop.place.load());
        sum.waiting.merge(hop.waiting);
        sum.running.merge(hop.running);
        sum.report.component = std::move(named.component);
        sum.report.topic = std::move(named.topic);
        sum.report.breaches_by_waiting += hop.breaches_by_waiting.get();
        sum.report.breaches_by_running += hop.breaches_by_running.get();
      }
    }
  }
  report.age = age.summary();
  report.count = report.age.count;
  std::vector<Sum*> order;  // By index; in alphabetical order where that is equal.
  for (auto& [name, sum] : sums) {
    sum.report.waiting = sum.waiting.summary();
    sum.report.running = sum.running.summary();
    order.push_back(&sum);
  }
  std::ranges::sort(order, {}, [](const Sum* sum) {
    return std::tie(sum->place, sum->report.component, sum->report.topic);
  });
  for (Sum* sum : order) {
    report.hops.push_back(std::move(sum->report));
  }
  return report;
}

std::vector<ChainReport> Chains::report() const {
  std::vector<ChainReport> reports;
  for (std::size_t i = 0; i < application_.description().chains.size(); ++i) {
    // One at a time, so that the lock on the topics is not held for all of them.
    wiring_.look([&](const detail::Topics& topics) { reports.push_back(report_of(topics, i)); });
  }
  return reports;
}

}  // namespace fastcycle::host

#include "host/peer_news.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "component/time_driver.h"
#include "component/wiring.h"
#include "component/words.h"
#include "host/callbacks.h"
#include "host/unmatched.h"

namespace fastcycle::host {

using detail::ComponentCore;
using detail::ComponentState;
using nlohmann::json;

namespace {

constexpr std::int64_t kGapNs = 5'000'000;       // Between two notices of one component.
constexpr std::int64_t kPeriodNs = 100'000'000;  // Between two looks at all figures,
constexpr std::int64_t kShare = 100;             // and so many times what one takes.
constexpr std::size_t kMostOfAText = 1000;

std::string shortened(const std::string& text) {
  return text.substr(0, kMostOfAText);
}

json to_json(const base::HistogramSummary& summary) {
  return {summary.count, summary.mean, summary.standard_deviation, summary.p50, summary.p99,
          summary.p999,  summary.max};
}

base::HistogramSummary summary_from(const json& said) {
  return {.count = said.at(0),
          .mean = said.at(1),
          .standard_deviation = said.at(2),
          .p50 = said.at(3),
          .p99 = said.at(4),
          .p999 = said.at(5),
          .max = said.at(6)};
}

json to_json(const base::HistogramBuckets& buckets) {
  return buckets.count == 0 ? json() : json{buckets.below, buckets.count, buckets.sum_ns};
}

base::HistogramBuckets buckets_from(const json& said) {
  if (said.is_null()) {
    return {};
  }
  return {.below = said.at(0), .count = said.at(1), .sum_ns = said.at(2)};
}

json to_json(const FiguresElsewhere::Subscription& subscription) {
  const detail::Ledger& ledger = subscription.ledger;
  return {{"topic", subscription.topic},
          {"kind", subscription.kind},
          {"depth", subscription.depth},
          {"drops_oldest", subscription.drops_oldest},
          {"published", ledger.published},
          {"delivered", ledger.delivered},
          {"dropped", ledger.dropped},
          {"queued", ledger.queued},
          {"latency", to_json(subscription.latency)},
          {"latency_buckets", to_json(subscription.latency_buckets)},
          {"unmatched", subscription.unmatched}};
}

FiguresElsewhere::Subscription subscription_from(const json& said) {
  FiguresElsewhere::Subscription subscription{
      .topic = said.at("topic"),
      .kind = said.at("kind"),
      .depth = said.at("depth"),
      .drops_oldest = said.at("drops_oldest"),
      .ledger = {.published = said.at("published"),
                 .delivered = said.at("delivered"),
                 .dropped = {},
                 .queued = said.at("queued")},
      .latency = summary_from(said.at("latency")),
      .latency_buckets = buckets_from(said.at("latency_buckets")),
      .unmatched = said.at("unmatched")};
  const json& dropped = said.at("dropped");
  for (std::size_t i = 0; i < subscription.ledger.dropped.size(); ++i) {
    subscription.ledger.dropped[i] = dropped.at(i);
  }
  return subscription;
}

json to_json(const ChainReport& chain) {
  json hops = json::array();
  for (const HopReport& hop : chain.hops) {
    hops.push_back({hop.component, hop.topic, to_json(hop.waiting), to_json(hop.running),
                    hop.breaches_by_waiting, hop.breaches_by_running});
  }
  return {{"name", chain.name},       {"count", chain.count},      {"breaches", chain.breaches},
          {"dropped", chain.dropped}, {"age", to_json(chain.age)}, {"hops", std::move(hops)}};
}

ChainReport chain_from(const json& said) {
  ChainReport chain{.name = said.at("name"),
                    .count = said.at("count"),
                    .breaches = said.at("breaches"),
                    .dropped = said.at("dropped"),
                    .age = summary_from(said.at("age"))};
  for (const json& hop : said.at("hops")) {
    chain.hops.push_back({.component = hop.at(0),
                          .topic = hop.at(1),
                          .waiting = summary_from(hop.at(2)),
                          .running = summary_from(hop.at(3)),
                          .breaches_by_waiting = hop.at(4),
                          .breaches_by_running = hop.at(5)});
  }
  return chain;
}

json to_json(const detail::VersionNews& version) {
  return {{"library", shortened(version.library)},
          {"build_id", shortened(version.build_id)},
          {"is_on_probation", version.is_on_probation},
          {"reloads", version.reloads},
          {"rollbacks", version.rollbacks},
          {"last", shortened(version.last)}};
}

detail::VersionNews version_from(const json& said) {
  return {.library = said.at("library"),
          .build_id = said.at("build_id"),
          .is_on_probation = said.at("is_on_probation"),
          .reloads = said.at("reloads"),
          .rollbacks = said.at("rollbacks"),
          .last = said.at("last")};
}

std::string to_text(const ComponentNews& news, bool has_figures) {
  json said{
      {"state", news.elsewhere->state},           {"health", news.health},
      {"reason", shortened(news.health_reason)},  {"faults", news.faults},
      {"last_fault", shortened(news.last_fault)}, {"restarts", news.restarts},
      {"version", to_json(news.version)},         {"is_urgent", news.is_urgent},
      {"ends_process", news.ends_process},        {"activations", news.elsewhere->activations},
      {"overruns", news.elsewhere->overruns},     {"hang", shortened(news.elsewhere->hang)}};
  said["chains"] = json::array();
  for (const ChainNews& chain : news.chains) {
    said["chains"].push_back({chain.chain, chain.count, chain.breaches, chain.dropped});
  }
  if (has_figures) {
    said["executor"] = news.elsewhere->executor;
    said["callback"] = to_json(news.elsewhere->callback);
    said["lateness"] = to_json(news.elsewhere->lateness);
    said["callback_buckets"] = to_json(news.elsewhere->callback_buckets);
    said["lateness_buckets"] = to_json(news.elsewhere->lateness_buckets);
    said["callbacks"] = json::array();
    for (const FiguresElsewhere::Callback& callback : news.elsewhere->callbacks) {
      said["callbacks"].push_back({callback.name, callback.kind, to_json(callback.run_time)});
    }
    said["subscriptions"] = json::array();
    for (const auto& subscription : news.elsewhere->subscriptions) {
      said["subscriptions"].push_back(to_json(subscription));
    }
    said["chain_reports"] = json::array();
    for (const ChainReport& chain : news.elsewhere->chains) {
      said["chain_reports"].push_back(to_json(chain));
    }
  }
  return said.dump(-1, ' ', false, json::error_handler_t::replace);
}

/// The same with figures of the component and of each subscription, but without their details.
ComponentNews without_details(ComponentNews news) {
  news.elsewhere->callback_buckets = {};
  news.elsewhere->lateness_buckets = {};
  news.elsewhere->callbacks.clear();
  for (FiguresElsewhere::Subscription& subscription : news.elsewhere->subscriptions) {
    subscription.latency_buckets = {};
    subscription.unmatched.clear();
  }
  return news;
}

/// None if it is no news: the sending process may be broken. Without figures, those of `before` are
/// kept.
std::optional<ComponentNews> news_from(const std::string& text, const ComponentNews& before) {
  try {
    const json said = json::parse(text);
    const auto state = said.at("state").get<unsigned>();
    const auto health = said.at("health").get<unsigned>();
    if (state > static_cast<unsigned>(ComponentState::kFailed) ||
        health > static_cast<unsigned>(Health::kFailed)) {
      return std::nullopt;
    }
    ComponentNews news{.health = static_cast<Health>(health),
                       .health_reason = said.at("reason"),
                       .faults = said.at("faults"),
                       .last_fault = said.at("last_fault"),
                       .restarts = said.at("restarts"),
                       .version = version_from(said.at("version")),
                       .ends_process = said.at("ends_process"),
                       .is_urgent = said.at("is_urgent"),
                       .elsewhere = before.elsewhere};
    for (const json& chain : said.at("chains")) {
      news.chains.push_back({.chain = chain.at(0),
                             .count = chain.at(1),
                             .breaches = chain.at(2),
                             .dropped = chain.at(3)});
    }
    FiguresElsewhere& elsewhere = news.elsewhere ? *news.elsewhere : news.elsewhere.emplace();
    elsewhere.state = static_cast<ComponentState>(state);
    elsewhere.activations = said.at("activations");
    elsewhere.overruns = said.at("overruns");
    elsewhere.hang = said.at("hang");
    if (said.contains("callback")) {
      elsewhere.executor = said.at("executor");
      elsewhere.callback = summary_from(said.at("callback"));
      elsewhere.lateness = summary_from(said.at("lateness"));
      elsewhere.callback_buckets = buckets_from(said.at("callback_buckets"));
      elsewhere.lateness_buckets = buckets_from(said.at("lateness_buckets"));
      elsewhere.callbacks.clear();
      for (const json& one : said.at("callbacks")) {
        elsewhere.callbacks.push_back(
            {.name = one.at(0), .kind = one.at(1), .run_time = summary_from(one.at(2))});
      }
      elsewhere.subscriptions.clear();
      for (const json& one : said.at("subscriptions")) {
        elsewhere.subscriptions.push_back(subscription_from(one));
      }
      elsewhere.chains.clear();
      for (const json& chain : said.at("chain_reports")) {
        elsewhere.chains.push_back(chain_from(chain));
      }
    }
    return news;
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

}  // namespace

void PeerNews::begin() {
  for (const auto& component : application_.components()) {
    its_.push_back({.news = news_of(*component)});
  }
  has_begun_.store(true, std::memory_order_release);
}

void PeerNews::send_all() {
  if (application_.peers()->is_main()) {
    return;
  }
  take_figures();
  const std::lock_guard lock(mutex_);
  for (Its& its : its_) {
    const ComponentCore& core = *application_.components()[its.news.component];
    if (!application_.runs_elsewhere(core.name)) {
      its.is_new = true;
      send(its);
    }
  }
}

void PeerNews::round_is_over() {
  for (ComponentNews& news : std::exchange(next_, {})) {
    if (news.elsewhere && its_[news.component].ended_in == round_) {
      next_.push_back(std::move(news));
    } else {
      on_news(news);
    }
  }
  ++round_;
  const Time now = application_.clock().now();
  if (now - reported_all_at_ >= application_.description().status_period) {
    reported_all_at_ = now;
    send_all();
  }
}

void PeerNews::changed(ComponentCore& component, bool is_urgent) {
  if (component.index >= its_.size() || application_.peers()->is_main()) {
    return;
  }
  Its& its = its_[component.index];
  {
    const std::lock_guard lock(mutex_);
    const bool was_urgent = its.is_new && its.news.is_urgent;
    auto elsewhere = std::move(its.news.elsewhere);
    its.news = news_of(component);
    its.news.elsewhere = std::move(elsewhere);
    its.news.is_urgent = is_urgent || was_urgent;
    its.is_new = true;
  }
  if (application_.time().is_simulated()) {
    // At the end of the round: news of the next round must not be taken in that round.
    component.stage([this, &its] {
      const std::lock_guard lock(mutex_);
      send(its);
    });
  } else {
    application_.peers()->look();
  }
}

void PeerNews::send_end(ComponentCore& component) {
  Its& its = its_[component.index];
  const std::lock_guard lock(mutex_);
  its.news = news_of(component);
  its.news.ends_process = true;
  its.news.is_urgent = true;
  its.is_new = true;
  send(its);
}

void PeerNews::hang_changed(const ComponentCore& component) {
  if (component.index >= its_.size() || application_.peers()->is_main()) {
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    its_[component.index].is_new = true;
    its_[component.index].news.is_urgent = true;
  }
  application_.peers()->look();
}

/// Sends what is new. The mutex is held.
void PeerNews::send(Its& its) {
  if (!std::exchange(its.is_new, false)) {
    return;
  }
  const ComponentCore& core = *application_.components()[its.news.component];
  its.reported_ns = base::monotonic_ns();
  if (!its.news.elsewhere) {
    its.news.elsewhere.emplace();
  }
  its.news.elsewhere->state = core.state.load();
  its.news.elsewhere->activations = core.statistics.activations.get();
  its.news.elsewhere->overruns = core.statistics.overruns.get();
  its.news.elsewhere->hang = core.hang();
  const bool has_figures = std::exchange(its.has_figures, false);
  try {
    application_.peers()->send_notice(Notice::Kind::kNews, core.index,
                                      to_text(its.news, has_figures));
  } catch (const std::length_error&) {  // It has very many subscriptions.
    send_less(its.news, has_figures);
  }
  its.news.is_urgent = false;
}

/// Sends as much of `news` as a notice holds, where it does not hold all.
void PeerNews::send_less(const ComponentNews& news, bool has_figures) {
  const auto index = static_cast<std::uint32_t>(news.component);
  try {
    application_.peers()->send_notice(Notice::Kind::kNews, index,
                                      to_text(without_details(news), has_figures));
  } catch (const std::length_error&) {
    application_.peers()->send_notice(Notice::Kind::kNews, index, to_text(news, false));
  }
}

/// Of all components here.
void PeerNews::take_figures() {
  std::map<std::string, std::vector<FiguresElsewhere::Subscription>> found;
  std::map<std::string, std::string> judges;  // By topic: the first of those that judge chains.
  std::map<std::string, std::vector<KnownCallback>> callbacks;
  wiring_.look([&](const detail::Topics& topics) {
    callbacks = find_callbacks(topics, application_.components());
    for (const auto& [name, topic] : topics.all()) {
      for (const auto& one : topic->subscriptions) {
        if (one->chain_end != nullptr) {
          judges.emplace(name, one->component);
        }
        found[one->component].push_back({.topic = name,
                                         .kind = to_word(one->kind),
                                         .depth = one->depth,
                                         .drops_oldest = one->overflow == Overflow::kDropOldest,
                                         .ledger = one->ledger(),
                                         .latency = one->latency.summary(),
                                         .latency_buckets = one->latency.buckets()});
        for (UnmatchedReport& unmatched : find_unmatched(*one)) {
          found[one->component].back().unmatched.push_back(std::move(unmatched.text));
        }
      }
    }
  });
  std::map<std::string, std::vector<ChainReport>> chains;
  for (ChainReport& chain : chains_.report()) {
    if (const auto judge = judges.find(chain.to); chain.count > 0 && judge != judges.end()) {
      chains[judge->second].push_back(std::move(chain));
    }
  }
  const std::lock_guard lock(mutex_);
  for (Its& its : its_) {
    const ComponentCore& core = *application_.components()[its.news.component];
    if (application_.runs_elsewhere(core.name)) {
      continue;
    }
    if (!its.news.elsewhere) {
      its.news.elsewhere.emplace();
    }
    its.news.elsewhere->chains = std::move(chains[core.name]);
    its.news.elsewhere->executor =
        core.description.executor.empty() ? kPoolName : core.description.executor;
    its.news.elsewhere->callback = core.statistics.callback.summary();
    its.news.elsewhere->lateness = core.statistics.lateness.summary();
    its.news.elsewhere->callback_buckets = core.statistics.callback.buckets();
    its.news.elsewhere->lateness_buckets = core.statistics.lateness.buckets();
    its.news.elsewhere->callbacks.clear();
    for (const KnownCallback& callback : callbacks[core.name]) {
      its.news.elsewhere->callbacks.push_back(
          {.name = callback.name, .kind = callback.kind, .run_time = callback.run_time->summary()});
    }
    its.news.elsewhere->subscriptions = std::move(found[core.name]);
    its.is_new = true;
    its.has_figures = true;
  }
}

std::int64_t PeerNews::look() {
  if (application_.peers()->is_main()) {
    return base::kNever;
  }
  const std::int64_t now_ns = base::monotonic_ns();
  if (!has_begun_.load(std::memory_order_acquire)) {
    return now_ns + kPeriodNs;
  }
  if (now_ns >= figures_at_ns_) {
    take_figures();
    const std::int64_t end_ns = base::monotonic_ns();
    figures_at_ns_ = end_ns + std::max(kPeriodNs, kShare * (end_ns - now_ns));
  }
  std::int64_t next_ns = figures_at_ns_;
  const std::lock_guard lock(mutex_);
  for (Its& its : its_) {
    if (!its.is_new) {
      continue;
    }
    if (now_ns >= its.reported_ns + kGapNs) {
      send(its);
    } else {
      next_ns = std::min(next_ns, its.reported_ns + kGapNs);
    }
  }
  return next_ns;
}

void PeerNews::take(const Notice& notice) {
  if (!application_.peers()->is_main() || !has_begun_.load(std::memory_order_acquire)) {
    return;
  }
  if (notice.kind == Notice::Kind::kGone) {
    process_has_ended(notice);
  } else if (notice.kind == Notice::Kind::kNews && notice.component < its_.size()) {
    const std::string& name = application_.components()[notice.component]->name;
    if (application_.peers()->process_of(name) == notice.process) {
      if (auto news = news_from(notice.text, its_[notice.component].news)) {
        receive(notice.component, std::move(*news));
      }
    }
  }
}

void PeerNews::receive(std::uint32_t component, ComponentNews news) {
  Its& its = its_[component];
  news.component = component;
  news.faults += its.faults_before;
  news.restarts += its.restarts_before;
  news.version.reloads += its.reloads_before;
  news.version.rollbacks += its.rollbacks_before;
  // In the order of its subscriptions, also after a restart.
  for (std::size_t i = 0; i < std::min(news.chains.size(), its.chains_before.size()); ++i) {
    news.chains[i].count += its.chains_before[i].count;
    news.chains[i].breaches += its.chains_before[i].breaches;
    news.chains[i].dropped += its.chains_before[i].dropped;
  }
  const bool has_faulted = news.faults > its.news.faults;
  {
    const std::lock_guard lock(mutex_);  // For `version_of`.
    its.news = news;
  }
  if (has_faulted) {
    on_fault(*application_.components()[component], news.last_fault);
  }
  // The restart takes no simulated time; that it was needed is to be seen nevertheless.
  if (its.ended_in == round_) {
    next_.push_back(std::move(news));
  } else {
    on_news(news);
  }
}

/// Its components have failed with it; restarted ones count from zero.
void PeerNews::process_has_ended(const Notice& notice) {
  const std::uint32_t process = notice.process;
  const bool is_restarted = notice.text == Notice::kRestarts;
  std::string why;  // Which component ended it, if one did.
  for (const auto& component : application_.components()) {
    if (component->index < its_.size() && its_[component->index].news.ends_process &&
        application_.peers()->process_of(component->name) == process) {
      why = fmt::format(", ended by \"{}\": {}", component->name,
                        its_[component->index].news.last_fault);
      its_[component->index].news.ends_process = false;
    }
  }
  for (const auto& component : application_.components()) {
    if (component->index >= its_.size() ||
        application_.peers()->process_of(component->name) != process) {
      continue;
    }
    const std::string& name = component->description.process;
    Its& its = its_[component->index];
    its.ended_in = application_.time().is_simulated() ? round_ : 0;
    its.faults_before = its.news.faults + 1;
    its.restarts_before = its.news.restarts + (is_restarted ? 1 : 0);
    // It begins with the library of the application file again.
    its.reloads_before = its.news.version.reloads;
    its.rollbacks_before = its.news.version.rollbacks + (its.news.version.is_on_probation ? 1 : 0);
    its.chains_before = its.news.chains;
    const std::string what = "its process \"" + name + "\" has ended" + why;
    its.last_end = what;
    ComponentNews news{
        .component = component->index,
        .health = Health::kFailed,
        .health_reason = what,
        .faults = its.faults_before,
        .last_fault = what,
        .restarts = its.restarts_before,
        .version = {.library = component->description.library,
                    .build_id = {},
                    .is_on_probation = false,
                    .reloads = its.reloads_before,
                    .rollbacks = its.rollbacks_before,
                    .last = its.news.version.is_on_probation ? "rolled back: " + what
                                                             : its.news.version.last},
        .chains = its.chains_before,
        .is_urgent = true,
        .elsewhere = FiguresElsewhere{.state = is_restarted ? ComponentState::kRestarting
                                                            : ComponentState::kFailed}};
    {
      const std::lock_guard lock(mutex_);
      its.news = news;
    }
    on_fault(*component, what);
    on_news(news);
    if (!is_restarted) {
      on_lost(*component, what);
    }
  }
}

std::vector<EarlierRuns> PeerNews::earlier_runs() const {
  std::vector<EarlierRuns> all;
  for (std::size_t component = 0; component < its_.size(); ++component) {
    const Its& its = its_[component];
    if (its.faults_before > 0) {
      all.push_back({.component = application_.components()[component]->name,
                     .faults = its.faults_before,
                     .restarts = its.restarts_before,
                     .reloads = its.reloads_before,
                     .rollbacks = its.rollbacks_before,
                     .last_end = its.last_end,
                     .chains = its.chains_before});
    }
  }
  return all;
}

std::vector<ChainReport> PeerNews::chains() const {
  std::vector<ChainReport> all = chains_.report();
  if (!has_begun_.load(std::memory_order_acquire)) {
    return all;
  }
  const std::lock_guard lock(mutex_);
  for (const Its& its : its_) {
    if (!its.news.elsewhere) {
      continue;
    }
    for (const ChainReport& chain : its.news.elsewhere->chains) {
      const auto known = std::ranges::find(all, chain.name, &ChainReport::name);
      if (known != all.end() && chain.count > known->count) {  // It is judged where it ends.
        known->count = chain.count;
        known->breaches = chain.breaches;
        known->dropped = chain.dropped;
        known->age = chain.age;
        known->hops = chain.hops;
      }
    }
  }
  return all;
}

detail::VersionNews PeerNews::version_of(std::uint32_t component) const {
  if (!has_begun_.load(std::memory_order_acquire)) {
    return {};
  }
  const std::lock_guard lock(mutex_);
  return component < its_.size() ? its_[component].news.version : detail::VersionNews();
}

}  // namespace fastcycle::host

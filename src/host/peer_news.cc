#include "host/peer_news.h"

#include <algorithm>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "component/time_driver.h"

namespace fastcycle::host {

using detail::ComponentCore;
using detail::ComponentState;
using nlohmann::json;

namespace {

constexpr std::int64_t kGapNs = 5'000'000;         // Between two notices of one component.
constexpr std::int64_t kPeriodNs = 1'000'000'000;  // Of how often it was activated.
constexpr std::size_t kMostOfAText = 1000;

std::string shortened(const std::string& text) {
  return text.substr(0, kMostOfAText);
}

std::string to_text(const ComponentNews& news) {
  return json{{"state", news.elsewhere->state},
              {"health", news.health},
              {"reason", shortened(news.health_reason)},
              {"faults", news.faults},
              {"last_fault", shortened(news.last_fault)},
              {"restarts", news.restarts},
              {"is_urgent", news.is_urgent},
              {"activations", news.elsewhere->activations},
              {"overruns", news.elsewhere->overruns},
              {"hang", shortened(news.elsewhere->hang)}}
      .dump(-1, ' ', false, json::error_handler_t::replace);
}

/// None if it is no news: another process says it, which may be broken.
std::optional<ComponentNews> news_from(const std::string& text) {
  try {
    const json said = json::parse(text);
    const auto state = said.at("state").get<unsigned>();
    const auto health = said.at("health").get<unsigned>();
    if (state > static_cast<unsigned>(ComponentState::kFailed) ||
        health > static_cast<unsigned>(Health::kFailed)) {
      return std::nullopt;
    }
    return ComponentNews{
        .health = static_cast<Health>(health),
        .health_reason = said.at("reason"),
        .faults = said.at("faults"),
        .last_fault = said.at("last_fault"),
        .restarts = said.at("restarts"),
        .is_urgent = said.at("is_urgent"),
        .elsewhere = ComponentNews::Elsewhere{.state = static_cast<ComponentState>(state),
                                              .activations = said.at("activations"),
                                              .overruns = said.at("overruns"),
                                              .hang = said.at("hang")}};
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

}  // namespace

void PeerNews::begin() {
  for (const auto& component : application_.components()) {
    its_.push_back({.news = news_of(*component)});
  }
}

void PeerNews::tell_all() {
  if (application_.peers()->is_main()) {
    return;
  }
  const std::lock_guard lock(mutex_);
  for (Its& its : its_) {
    const ComponentCore& core = *application_.components()[its.news.component];
    if (!application_.runs_elsewhere(core.name)) {
      its.is_new = true;
      tell(its);
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
  if (now - told_all_ >= application_.description().status_period) {
    told_all_ = now;
    tell_all();
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
    its.news = news_of(component);
    its.news.is_urgent = is_urgent || was_urgent;
    its.is_new = true;
  }
  if (application_.time().is_simulated()) {
    // When the round is over: what it says in the next one is not to be heard in it.
    component.stage([this, &its] {
      const std::lock_guard lock(mutex_);
      tell(its);
    });
  } else {
    application_.peers()->look();
  }
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

/// What is new. The mutex is held.
void PeerNews::tell(Its& its) {
  if (!std::exchange(its.is_new, false)) {
    return;
  }
  const ComponentCore& core = *application_.components()[its.news.component];
  its.told_ns = base::monotonic_ns();
  its.told_activations = core.statistics.activations.get();
  its.news.elsewhere = {.state = core.state.load(),
                        .activations = its.told_activations,
                        .overruns = core.statistics.overruns.get(),
                        .hang = core.hang()};
  application_.peers()->tell(Notice::Kind::kNews, core.index, to_text(its.news));
  its.news.is_urgent = false;
}

std::int64_t PeerNews::look() {
  if (application_.peers()->is_main()) {
    return base::kNever;
  }
  const std::int64_t now_ns = base::monotonic_ns();
  std::int64_t next_ns = base::kNever;
  const std::lock_guard lock(mutex_);
  for (Its& its : its_) {
    const ComponentCore& core = *application_.components()[its.news.component];
    if (application_.runs_elsewhere(core.name)) {
      continue;
    }
    if (now_ns >= its.told_ns + kPeriodNs &&
        core.statistics.activations.get() != its.told_activations) {
      its.is_new = true;
    }
    if (!its.is_new) {
      continue;
    }
    if (now_ns >= its.told_ns + kGapNs) {
      tell(its);
    } else {
      next_ns = std::min(next_ns, its.told_ns + kGapNs);
    }
  }
  return next_ns;
}

void PeerNews::take(const Notice& notice) {
  if (!application_.peers()->is_main()) {
    return;
  }
  if (notice.kind == Notice::Kind::kGone) {
    process_has_ended(notice.process);
  } else if (notice.kind == Notice::Kind::kNews && notice.component < its_.size()) {
    const std::string& name = application_.components()[notice.component]->name;
    if (application_.peers()->process_of(name) == notice.process) {
      if (auto news = news_from(notice.text)) {
        hear(notice.component, std::move(*news));
      }
    }
  }
}

void PeerNews::hear(std::uint32_t component, ComponentNews news) {
  Its& its = its_[component];
  news.component = component;
  news.faults += its.faults_before;
  news.restarts += its.restarts_before;
  its.news = news;
  // The restart takes no simulated time; that it was needed is to be seen nevertheless.
  if (its.ended_in == round_) {
    next_.push_back(std::move(news));
  } else {
    on_news(news);
  }
}

/// Its components have failed with it; those that come again begin to count anew.
void PeerNews::process_has_ended(std::uint32_t process) {
  for (const auto& component : application_.components()) {
    if (component->index >= its_.size() ||
        application_.peers()->process_of(component->name) != process) {
      continue;
    }
    const std::string& name = component->description.process;
    const auto& processes = application_.description().processes;
    const auto described = std::ranges::find(processes, name, &config::ProcessDescription::name);
    const bool is_restarted =
        described != processes.end() && described->on_exit == config::OnExit::kRestart;
    Its& its = its_[component->index];
    its.ended_in = application_.time().is_simulated() ? round_ : 0;
    its.faults_before = its.news.faults + 1;
    its.restarts_before = its.news.restarts + (is_restarted ? 1 : 0);
    const std::string what = "its process \"" + name + "\" has ended";
    ComponentNews news{
        .component = component->index,
        .health = Health::kFailed,
        .health_reason = what,
        .faults = its.faults_before,
        .last_fault = what,
        .restarts = its.restarts_before,
        .is_urgent = true,
        .elsewhere = ComponentNews::Elsewhere{.state = is_restarted ? ComponentState::kRestarting
                                                                    : ComponentState::kFailed}};
    its.news = news;
    on_news(news);
  }
}

}  // namespace fastcycle::host

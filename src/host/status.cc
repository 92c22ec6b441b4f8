#include "host/status.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <optional>
#include <utility>

#include "base/utf8.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "component/own_names.h"
#include "component/time_driver.h"
#include "component/wiring.h"
#include "config/parse.h"
#include "modes/chains.h"
#include "modes/modes.h"
#include "record/recorder.h"

namespace fastcycle::host {

using detail::Cause;
using detail::ComponentCore;

namespace {

status::State to_message(ComponentCore::State state) {
  switch (state) {
    case ComponentCore::State::kDeclared:
      return status::STATE_DECLARED;
    case ComponentCore::State::kConstructed:
      return status::STATE_CONSTRUCTED;
    case ComponentCore::State::kStandby:
      return status::STATE_STANDBY;
    case ComponentCore::State::kActive:
      return status::STATE_ACTIVE;
    case ComponentCore::State::kRestarting:
      return status::STATE_RESTARTING;
    case ComponentCore::State::kStopped:
      return status::STATE_STOPPED;
    case ComponentCore::State::kFailed:
      return status::STATE_FAILED;
  }
  return status::STATE_DECLARED;
}

status::Health to_message(Health health) {
  switch (health) {
    case Health::kOk:
      return status::HEALTH_OK;
    case Health::kDegraded:
      return status::HEALTH_DEGRADED;
    case Health::kFailed:
      return status::HEALTH_FAILED;
  }
  return status::HEALTH_OK;
}

void fill_ledger(const detail::Ledger& ledger, status::Subscription& reported) {
  reported.set_published(ledger.published);
  reported.set_delivered(ledger.delivered);
  for (std::size_t reason = 0; reason < ledger.dropped.size(); ++reason) {
    if (ledger.dropped[reason] > 0) {
      status::Drop& drop = *reported.add_drops();
      drop.set_reason(detail::to_word(static_cast<detail::DropReason>(reason)));
      drop.set_count(ledger.dropped[reason]);
    }
  }
  reported.set_queued(ledger.queued);
}

/// How many messages of `topic` the component of `subscription` keeps as samples.
std::uint64_t kept_of(const detail::Topic& topic, const detail::Subscription& subscription) {
  std::uint64_t kept = 0;
  for (const auto& publisher : topic.publishers) {
    kept += publisher->kept_by(subscription.holder);
  }
  return kept;
}

}  // namespace

ComponentNews news_of(const ComponentCore& core) {
  std::vector<ChainNews> chains;
  for (const detail::CallbackSubscription* subscription : core.subscriptions.callbacks()) {
    if (subscription->chain_end == nullptr) {
      continue;
    }
    for (const auto& end : subscription->chain_end->chains()) {
      chains.push_back({.chain = end->rule.chain,
                        .count = end->age.count(),
                        .breaches = end->breaches.get(),
                        .dropped = end->dropped.get()});
    }
  }
  return {.component = core.index,
          .health = core.health,
          .health_reason = base::to_utf8(core.health_reason),
          .faults = core.fault_count,
          .last_fault = base::to_utf8(core.last_fault),
          .restarts = core.renewals(),
          .version = core.versions->news(),
          .chains = std::move(chains)};
}

bool PendingNews::put(ComponentNews news) {
  const std::lock_guard lock(mutex_);
  std::optional<ComponentNews>& pending = pending_.at(news.component);
  const bool is_first = !pending.has_value();
  news.is_urgent = news.is_urgent || (pending && pending->is_urgent);
  pending = std::move(news);
  return is_first;
}

ComponentNews PendingNews::take(std::size_t component) {
  const std::lock_guard lock(mutex_);
  return *std::exchange(pending_.at(component), std::nullopt);
}

void StatusSender::set_status(ComponentCore& status, std::size_t components) {
  status_ = &status;
  pending_.set_count(components);
  time_.set_watcher(status);
}

void StatusSender::changed(ComponentCore& component, bool is_urgent) {
  // Behind the status there are only FastCycle's own components, which it does not report.
  if (status_ == nullptr || component.index >= status_->index || is_over_) {
    return;
  }
  ComponentNews news = news_of(component);
  news.is_urgent = is_urgent;
  if (!pending_.put(std::move(news))) {
    return;
  }
  if (!time_.is_simulated()) {
    status_->post(Cause::kEvent,
                  [this, index = component.index] { deliver(pending_.take(index)); });
    return;
  }
  // At the end of the round: news of the next round must not be taken in that round.
  component.stage([this, index = component.index] {
    status_->post(Cause::kEvent, [this, its_news = pending_.take(index)] { deliver(its_news); });
  });
}

void StatusSender::changed_elsewhere(ComponentNews news) {
  const std::size_t index = news.component;
  if (status_ == nullptr || index >= status_->index || is_over_ || !pending_.put(std::move(news))) {
    return;
  }
  status_->post(Cause::kEvent, [this, index] { deliver(pending_.take(index)); });
}

void StatusSender::deliver(const ComponentNews& news) const {
  if (status_->component != nullptr) {
    static_cast<StatusComponent*>(status_->component)->update(news);
  }
}

void StatusSender::mode_changed() {
  if (status_ == nullptr || is_over_) {
    return;
  }
  status_->post(Cause::kEvent, [status = status_] {
    if (status->component != nullptr) {
      static_cast<StatusComponent*>(status->component)->publish_status();
    }
  });
}

StatusComponent::StatusComponent(Context& context)
    : Component(context),
      time_(context.core().application.time()),
      statuses_(context.create_publisher<status::Status>(std::string("/") + kStatusTopic)) {
  context.create_timer({.period = context.core().application.description().status_period},
                       [this] { publish_status(); });
}

void StatusComponent::set_sources(const StatusSources& sources) {
  sources_.emplace(sources);
  component_news_.clear();
  for (const auto& core : sources.application.components()) {
    if (core.get() != &context().core()) {
      component_news_.push_back(news_of(*core));
    }
  }
}

void StatusComponent::start() {
  is_started_ = true;
  publish_status();
}

void StatusComponent::update(const ComponentNews& news) {
  if (news.component < component_news_.size()) {
    component_news_[news.component] = news;
    if (news.is_urgent) {
      publish_status();
    }
  }
}

void StatusComponent::publish_status() {
  if (!is_started_) {
    return;
  }
  if (!time_.is_simulated()) {
    fill();
    publish();
    return;
  }
  // During a round, the progress of others depends on the workers. At its end, as this is the last
  // component, all of it was handed over.
  if (!std::exchange(is_due_, true)) {
    ComponentCore& core = context().core();
    core.stage([this, &core] {
      fill();
      core.post(detail::Cause::kEvent, [this] {
        is_due_ = false;
        publish();
      });
    });
  }
}

void StatusComponent::publish() {
  auto message = statuses_.loan_uncleared();
  message->Swap(&next_);
  message->mutable_header()->set_taken_ns(now().time_since_epoch().count());
  statuses_.publish(std::move(message));
}

void StatusComponent::fill() {
  next_.Clear();
  next_.set_application(sources_->application.description().name);
  next_.set_mode(sources_->modes.current());
  if (const record::Recorder* recorder = sources_->recorder) {
    next_.set_recording_trouble(base::to_utf8(recorder->trouble()));
  }
  for (std::size_t index = 0; index < component_news_.size(); ++index) {
    fill_component(index, *next_.add_components());
  }
  fill_chains();
  sources_->wiring.look([this](const detail::Topics& topics) {
    for (const auto& [name, topic] : topics.all()) {
      fill_topic(*topic);
    }
  });
  for (std::size_t index = 0; index < component_news_.size(); ++index) {
    if (!component_news_[index].elsewhere) {
      continue;
    }
    for (const auto& one : component_news_[index].elsewhere->subscriptions) {
      status::Subscription& reported = *next_.add_subscriptions();
      reported.set_topic(one.topic);
      reported.set_component(sources_->application.components()[index]->name);
      fill_ledger(one.ledger, reported);
    }
  }
}

/// In simulated time breaches are those of the news: these arrive in the same round, whether or not
/// the component that judges the chain is in this process.
void StatusComponent::fill_chains() {
  const std::vector<ChainReport> reports = sources_->chains.report();
  for (std::size_t chain = 0; chain < reports.size(); ++chain) {
    ChainNews sum{.count = reports[chain].count};
    if (!time_.is_simulated()) {
      sum.breaches = reports[chain].breaches;
      sum.dropped = reports[chain].dropped;
    }
    for (const ComponentNews& news : component_news_) {
      for (const ChainNews& its : news.chains) {
        if (its.chain == chain && (news.elsewhere || time_.is_simulated())) {
          sum.count += news.elsewhere ? its.count : 0;
          sum.breaches += its.breaches;
          sum.dropped += its.dropped;
        }
      }
    }
    status::Chain& reported = *next_.add_chains();
    reported.set_name(reports[chain].name);
    reported.set_count(sum.count);
    reported.set_breaches(sum.breaches);
    reported.set_dropped(sum.dropped);
  }
}

void StatusComponent::fill_component(std::size_t index, status::Component& component) const {
  const ComponentCore& core = *sources_->application.components()[index];
  const ComponentNews& news = component_news_[index];
  component.set_name(core.name);
  const ApplicationHost& application = sources_->application;
  component.set_state(news.elsewhere                          ? to_message(news.elsewhere->state)
                      : application.runs_elsewhere(core.name) ? status::STATE_ELSEWHERE
                      : application.is_replayed(core.name)    ? status::STATE_REPLAYED
                                                              : to_message(core.state.load()));
  component.set_health(to_message(news.health));
  component.set_health_reason(news.health_reason);
  component.set_hang(news.elsewhere ? news.elsewhere->hang : core.hang());
  component.set_activations(news.elsewhere ? news.elsewhere->activations
                                           : core.statistics.activations.get());
  component.set_faults(news.faults);
  component.set_overruns(news.elsewhere ? news.elsewhere->overruns
                                        : core.statistics.overruns.get());
  component.set_restarts(news.restarts);
  component.set_last_fault(news.last_fault);
  component.set_library(news.version.library);
  component.set_build_id(news.version.build_id);
  component.set_is_on_probation(news.version.is_on_probation);
  component.set_reloads(news.version.reloads);
  component.set_rollbacks(news.version.rollbacks);
  component.set_last_reload(base::to_utf8(news.version.last));
}

void StatusComponent::fill_topic(const detail::Topic& topic) {
  std::optional<Time> newest;
  for (const auto& publisher : topic.publishers) {
    if (publisher->published() > 0) {
      newest = std::max(newest.value_or(Time::min()), publisher->last_publish_time());
    }
  }
  for (const auto& subscription : topic.subscriptions) {
    if (subscription->kind == detail::Subscription::Kind::kTap) {
      continue;  // Its owner reports what it received and lost.
    }
    const detail::Ledger ledger = subscription->ledger();
    status::Subscription& reported = *next_.add_subscriptions();
    reported.set_topic(topic.name);
    reported.set_component(subscription->component);
    fill_ledger(ledger, reported);
    reported.set_kept(kept_of(topic, *subscription));
    if (newest) {
      const Duration age = std::max(Duration(0), sources_->application.clock().now() - *newest);
      reported.set_age_ms(std::chrono::duration<double, std::milli>(age).count());
    }
  }
}

config::ComponentDescription describe_status(const config::ApplicationDescription& application) {
  config::ComponentDescription description;
  description.name = kOwnName;
  description.place = application.place;
  description.params = config::Value::object_at(application.shared_params);
  const bool has_pool = std::ranges::any_of(
      application.components, [](const auto& component) { return component.executor.empty(); });
  const auto calm = std::ranges::find(application.executors, config::Policy::kOther,
                                      &config::ExecutorDescription::policy);
  if (!has_pool && calm != application.executors.end()) {
    description.executor = calm->name;
  }
  return description;
}

const ComponentClass& status_class() {
  static constexpr ComponentClass kClass{"Status",
                                         &fastcycle::detail::create_component<StatusComponent>,
                                         &fastcycle::detail::destroy_component<StatusComponent>};
  return kClass;
}

}  // namespace fastcycle::host

#include "host/status.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "config/parse.h"
#include "host/application.h"
#include "host/replay.h"

namespace fastcycle::host {

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

/// What somebody threw may be any bytes; a text of a message is UTF-8.
std::string to_text(std::string text) {
  if (!config::is_utf8(text)) {
    std::ranges::replace_if(
        text, [](char c) { return (static_cast<unsigned>(c) & 0x80U) != 0; }, '?');
  }
  return text;
}

}  // namespace

ComponentNews news_of(const ComponentCore& core) {
  return {.component = core.index,
          .health = core.health,
          .health_reason = to_text(core.health_reason),
          .faults = core.fault_count,
          .last_fault = to_text(core.last_fault),
          .restarts = core.restart_count};
}

StatusComponent::StatusComponent(Context& context)
    : Component(context),
      application_(context.core().application),
      statuses_(context.create_publisher<status::Status>(std::string("/") + kStatusTopic)) {
  for (const auto& core : application_.components()) {
    if (core.get() != &context.core()) {
      heard_.push_back(news_of(*core));
    }
  }
  context.create_timer({.period = application_.description().status_period}, [this] { say(); });
}

void StatusComponent::start() {
  is_started_ = true;
  say();
}

void StatusComponent::hear(const ComponentNews& news) {
  if (news.component < heard_.size()) {
    heard_[news.component] = news;
    if (news.is_urgent) {
      say();
    }
  }
}

void StatusComponent::say() {
  if (!is_started_) {
    return;
  }
  if (application_.simulation() == nullptr) {
    fill();
    publish();
    return;
  }
  // While a round runs, what others have done in it depends on the workers. When it is over, and
  // this is the last component, all of it was handed over.
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
  next_.set_application(application_.description().name);
  next_.set_mode(application_.modes().current());
  for (std::size_t index = 0; index < heard_.size(); ++index) {
    fill_component(index, *next_.add_components());
  }
  for (const ChainReport& chain : application_.chains().report()) {
    status::Chain& told = *next_.add_chains();
    told.set_name(chain.name);
    told.set_count(chain.count);
    told.set_breaches(chain.breaches);
    told.set_dropped(chain.dropped);
  }
  application_.look_at_topics([this](const detail::Topics& topics) {
    for (const auto& [name, topic] : topics.all()) {
      fill_topic(*topic);
    }
  });
}

void StatusComponent::fill_component(std::size_t index, status::Component& component) const {
  const ComponentCore& core = *application_.components()[index];
  const ComponentNews& news = heard_[index];
  const Replay* replay = application_.replay();
  component.set_name(core.name);
  component.set_state(replay != nullptr && !replay->plan().runs(core.name)
                          ? status::STATE_REPLAYED
                          : to_message(core.state.load()));
  component.set_health(to_message(news.health));
  component.set_health_reason(news.health_reason);
  component.set_activations(core.statistics.activations.get());
  component.set_faults(news.faults);
  component.set_overruns(core.statistics.overruns.get());
  component.set_restarts(news.restarts);
  component.set_last_fault(news.last_fault);
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
      continue;  // What it took, and what it lost, is told by its owner.
    }
    const detail::Ledger ledger = subscription->ledger();
    status::Subscription& told = *next_.add_subscriptions();
    told.set_topic(topic.name);
    told.set_component(subscription->component);
    told.set_published(ledger.published);
    told.set_delivered(ledger.delivered);
    for (std::size_t reason = 0; reason < ledger.dropped.size(); ++reason) {
      if (ledger.dropped[reason] > 0) {
        status::Drop& drop = *told.add_drops();
        drop.set_reason(detail::to_word(static_cast<detail::DropReason>(reason)));
        drop.set_count(ledger.dropped[reason]);
      }
    }
    told.set_queued(ledger.queued);
    if (newest) {
      const Duration age = std::max(Duration(0), application_.clock().now() - *newest);
      told.set_age_ms(std::chrono::duration<double, std::milli>(age).count());
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

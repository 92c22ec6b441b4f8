#include "component/wiring.h"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>

#include "component/component_core.h"
#include "component/time_driver.h"

namespace fastcycle::host {

using detail::Cause;
using detail::ComponentCore;

void Wiring::begin() {
  has_begun_ = true;
  is_running_ = true;
  for (const auto& component : components_) {
    for (detail::PublisherCore* publisher : component->declared.publishers) {
      if (publisher->options.is_external) {
        const std::lock_guard lock(publisher->mutex());
        publisher->set_external_stage(time_.external_stage());
        publisher->set_external_open(true);
      }
    }
  }
}

void Wiring::close_external(const std::function<bool(const ComponentCore&)>& goes_on) {
  for (const auto& component : components_) {
    if (goes_on(*component)) {
      continue;
    }
    for (detail::PublisherCore* publisher : component->declared.publishers) {
      if (publisher->options.is_external) {
        const std::lock_guard lock(publisher->mutex());
        publisher->set_external_open(false);
      }
    }
  }
}

detail::CallbackSubscription& Wiring::subscribe_late(
    ComponentCore& component, const std::string& name,
    const google::protobuf::Message& default_instance, const SubscriberOptions& options,
    detail::EnvelopeCallback callback) {
  const std::lock_guard lock(mutex_);
  detail::Topic* known = topics_.find(name);
  const std::string type = default_instance.GetTypeName();
  if (known != nullptr && !known->type.empty() && known->type != type) {
    throw std::runtime_error("topic \"" + name + "\" has the type " + known->type + ", not " +
                             type);
  }
  if (known != nullptr) {
    for (const auto& publisher : known->publishers) {
      const std::string& owner = component_of(*publisher).name;
      if (component.application.runs_elsewhere(owner)) {
        throw std::runtime_error("topic \"" + name + "\" comes from \"" + owner +
                                 "\", which runs in another process: subscribe in the constructor");
      }
    }
  }
  detail::Topic& topic = topics_.get(name, component.name, default_instance);
  auto& subscription = component.subscribe_again(topic, options, std::move(callback));
  for (const auto& publisher : topic.publishers) {
    connect_late(component, *publisher, subscription);
  }
  return subscription;
}

void Wiring::connect_late(ComponentCore& component, detail::PublisherCore& publisher,
                          detail::CallbackSubscription& subscription) {
  const auto lane = detail::Topics::make_lane(publisher, subscription);
  component.inbox.add(lane);
  if (publisher.options.is_external) {
    const std::lock_guard lock(publisher.mutex());
    publisher.connect(lane, component.inbox);
    return;
  }
  run_at(publisher, component,
         [&publisher, lane, &inbox = component.inbox] { publisher.connect(lane, inbox); });
}

void Wiring::run_at(detail::PublisherCore& publisher, ComponentCore& from,
                    std::function<void()> action) {
  ComponentCore& owner = component_of(publisher);
  // Deliveries to another component wait for the end of the round, latched messages too.
  owner.post(
      Cause::kConnect,
      [&time = time_, &owner, action = std::move(action)] { time.stage(owner, action); }, &from);
}

void Wiring::beside(detail::PublisherCore& publisher, std::function<void()> action) {
  if (time_.is_simulated()) {
    time_.between_rounds(std::move(action));
  } else if (publisher.options.is_external) {
    const std::lock_guard lock(publisher.mutex());
    action();
  } else {
    component_of(publisher).post(Cause::kConnect, std::move(action));
  }
}

void Wiring::reopen_subscription(ComponentCore& component,
                                 detail::CallbackSubscription& subscription) {
  if (!std::exchange(subscription.is_ended, false)) {
    return;
  }
  const std::lock_guard lock(mutex_);
  for (const auto& publisher : subscription.topic.publishers) {
    connect_late(component, *publisher, subscription);
  }
}

void Wiring::end_subscription(ComponentCore& component, detail::CallbackSubscription& subscription,
                              detail::DropReason reason) noexcept {
  if (subscription.is_ended) {
    return;
  }
  component.end(subscription, reason);
  for (const auto& lane : subscription.lanes()) {
    component.inbox.remove(*lane);
    lane->is_left_by_receiver = true;
  }
  const std::lock_guard lock(mutex_);
  for (const auto& publisher : subscription.topic.publishers) {
    const auto leave = [&publisher, lanes = subscription.lanes()] {
      for (const auto& lane : lanes) {
        publisher->disconnect(*lane);
      }
    };
    if (publisher->options.is_external) {
      const std::lock_guard publisher_lock(publisher->mutex());
      leave();
    } else if (is_running_) {
      run_at(*publisher, component, leave);
    }
  }
}

ComponentCore& Wiring::component_of(const detail::PublisherCore& publisher) const {
  const auto found = std::find_if(
      components_.begin(), components_.end(),
      [&](const auto& component) { return &component->publishing == &publisher.owner; });
  return **found;
}

void Wiring::report_liveliness(ComponentCore& component, bool is_alive, std::string_view reason) {
  if (!has_begun_) {
    return;
  }
  // In simulated time at the end of the round: whether a component that subscribes or unsubscribes
  // in the same round is notified must not depend on the order of workers.
  const auto report_all = [this, &component, is_alive, reason] {
    const std::lock_guard lock(mutex_);
    for (const detail::PublisherCore* publisher : component.declared.publishers) {
      for (const auto& subscription : publisher->topic.subscriptions) {
        if (subscription->kind != detail::Subscription::Kind::kCallback ||
            subscription->quality == nullptr || !subscription->quality->has_callback()) {
          continue;
        }
        auto& to = static_cast<detail::CallbackSubscription&>(*subscription);
        auto& receiver = static_cast<ComponentCore&>(to.actor);
        const auto report = [&to, &receiver, id = publisher->id, is_alive, reason] {
          if (receiver.state != ComponentCore::State::kActive || to.is_ended) {
            return;
          }
          const std::int64_t now_ns = base::to_ns(receiver.publishing.now);
          const auto event = to.quality->on_liveliness(id, is_alive, reason, now_ns);
          if (const auto callback = to.quality->callback(); event && callback != nullptr) {
            to.quality->keep(receiver.publishing, *event);
            (*callback)(*event);
          }
        };
        receiver.post(Cause::kEvent, report, nullptr, detail::Control::kNoTimer);
      }
    }
  };
  if (time_.is_simulated()) {
    component.stage(report_all);
  } else {
    report_all();
  }
}

}  // namespace fastcycle::host

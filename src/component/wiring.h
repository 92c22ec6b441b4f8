#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>

#include "base/priority_mutex.h"
#include "broker/topics.h"
#include "component/component_host.h"
#include "executor/actor.h"

namespace fastcycle::host {

class TimeDriver;

/// The connections of an application: owns its topics, and the lock for adding and removing
/// subscriptions while components run.
///
/// @threads  Stated for each part.
class Wiring final : public TopicHost {
 public:
  /// Both outlive this.
  Wiring(const Components& components, TimeDriver& time) : components_(components), time_(time) {}
  Wiring(const Wiring&) = delete;
  Wiring& operator=(const Wiring&) = delete;

  [[nodiscard]] detail::Topics& topics() override { return topics_; }
  [[nodiscard]] const detail::Topics& topics() const { return topics_; }
  /// Locks the topics while `look` reads their counters. Safe.
  template <typename Look>
  void look(const Look& look) const {
    const std::lock_guard lock(mutex_);
    look(topics_);
  }

  /// Components run from now on; control thread.
  void begin();
  /// Components stop: ended subscriptions are not disconnected any more.
  void end() { is_running_ = false; }
  /// Closes the external publishers of all components, except those for which `goes_on` holds.
  void close_external(const std::function<bool(const detail::ComponentCore&)>& goes_on);

  // In an activation of `component`.

  detail::CallbackSubscription& subscribe_late(detail::ComponentCore& component,
                                               const std::string& topic,
                                               const google::protobuf::Message& default_instance,
                                               const SubscriberOptions& options,
                                               detail::EnvelopeCallback callback) override;
  void end_subscription(detail::ComponentCore& component,
                        detail::CallbackSubscription& subscription,
                        detail::DropReason reason) noexcept override;
  void reopen_subscription(detail::ComponentCore& component,
                           detail::CallbackSubscription& subscription) override;
  void report_liveliness(detail::ComponentCore& component, bool is_alive,
                         std::string_view reason) override;

  /// Executes `action` while `publisher` does not publish, now or soon: in an activation of its
  /// component, for an external one under its lock, in simulated time between two rounds. For
  /// callers outside of components. Safe, from the start to the end, after which it may never be
  /// executed.
  void beside(detail::PublisherCore& publisher, std::function<void()> action);

 private:
  void connect_late(detail::ComponentCore& component, detail::PublisherCore& publisher,
                    detail::CallbackSubscription& subscription);
  void run_at(detail::PublisherCore& publisher, detail::ComponentCore& from,
              std::function<void()> action);
  [[nodiscard]] detail::ComponentCore& component_of(const detail::PublisherCore& publisher) const;

  const Components& components_;
  TimeDriver& time_;
  /// Control plane: guards adding and removing subscriptions. Observers may hold it at a low
  /// priority.
  mutable base::PriorityMutex mutex_;
  detail::Topics topics_;
  std::atomic<bool> has_begun_{false};
  std::atomic<bool> is_running_{false};
};

}  // namespace fastcycle::host

#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "config/description.h"
#include "fastcycle/component.h"
#include "fastcycle/library.h"
#include "status/status.pb.h"

namespace fastcycle::detail {
class ComponentCore;
class Topic;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class Application;

/// FastCycle's own component, and what its topics begin with.
inline constexpr const char* kOwnName = "fastcycle";
inline constexpr const char* kOwnTopics = "fastcycle/";
inline constexpr const char* kStatusTopic = "fastcycle/status";

/// What only a component itself knows of itself, as it hands it on.
struct ComponentNews {
  std::size_t component = 0;
  Health health = Health::kOk;
  std::string health_reason = {};
  std::uint64_t faults = 0;
  std::string last_fault = {};
  std::uint64_t restarts = 0;
  bool is_urgent = false;  ///< Not only for the next period.
};

/// What there is to say of `core` now; in its activation, or before the start.
[[nodiscard]] ComponentNews news_of(const detail::ComponentCore& core);

/// Publishes how the application does on `fastcycle/status`: every `status_period_ms`, and at once
/// when a component's state, health or faults change.
///
/// It is the application's last component, made only if somebody subscribes. What it says in
/// simulated time is how things stand when a round is over: the same for any number of workers.
///
/// @threads  As a component.
class StatusComponent final : public Component {
 public:
  explicit StatusComponent(Context& context);

  void start() override;

  /// In its activation: takes what another component said.
  void hear(const ComponentNews& news);
  /// In its activation: publishes how things are; in simulated time when this round is over.
  void say();

 private:
  void publish();
  void fill();
  void fill_component(std::size_t index, status::Component& component) const;
  void fill_topic(const detail::Topic& topic);

  Application& application_;
  Publisher<status::Status> statuses_;
  std::vector<ComponentNews> heard_;  ///< By component.
  status::Status next_;
  bool is_started_ = false;
  bool is_due_ = false;  ///< In simulated time: it will be published when this round is over.
};

/// How `StatusComponent` is added to an application: in a pool of workers without real-time policy,
/// if there is one.
[[nodiscard]] config::ComponentDescription describe_status(
    const config::ApplicationDescription& application);
[[nodiscard]] const ComponentClass& status_class();

}  // namespace fastcycle::host

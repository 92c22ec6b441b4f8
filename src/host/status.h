#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "config/description.h"
#include "fastcycle/component.h"
#include "fastcycle/library.h"
#include "host/status_news.h"
#include "status/status.pb.h"

namespace fastcycle::detail {
class Topic;
}  // namespace fastcycle::detail

namespace fastcycle::record {
class Recorder;
}  // namespace fastcycle::record

namespace fastcycle::host {

class ApplicationHost;
class Chains;
class Modes;
class Wiring;

/// The sources of a status. All live as long as the application.
struct StatusSources {
  const ApplicationHost& application;
  const Modes& modes;
  const Chains& chains;
  const Wiring& wiring;
  const record::Recorder* recorder = nullptr;  ///< Null without a recorder.
};

/// Publishes the application's status on `fastcycle/status`: every `status_period_ms`, and at once
/// when a component's state, health or faults change.
///
/// It follows the application's components, created only if there is a subscriber. In simulated
/// time it publishes the state at the end of a round: the same for any number of workers.
///
/// @threads  As a component.
class StatusComponent final : public Component {
 public:
  explicit StatusComponent(Context& context);

  /// Sets its sources; before it starts.
  void set_sources(const StatusSources& sources);

  void start() override;

  /// In its activation: takes the news of another component.
  void update(const ComponentNews& news);
  /// In its activation: publishes the status; in simulated time at the end of this round.
  void publish_status();

 private:
  void publish();
  void fill();
  void fill_component(std::size_t index, status::Component& component) const;
  void fill_chains();
  void fill_topic(const detail::Topic& topic);

  TimeDriver& time_;
  std::optional<StatusSources> sources_;
  Publisher<status::Status> statuses_;
  std::vector<ComponentNews> component_news_;  ///< By component.
  status::Status next_;
  bool is_started_ = false;
  bool is_due_ = false;  ///< In simulated time: it will be published at the end of this round.
};

/// How `StatusComponent` is added to an application: in a pool of workers without real-time policy,
/// if there is one.
[[nodiscard]] config::ComponentDescription describe_status(
    const config::ApplicationDescription& application);
[[nodiscard]] const ComponentClass& status_class();

}  // namespace fastcycle::host

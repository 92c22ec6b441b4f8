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

/// What a status is made of. All live as long as the application.
struct StatusSources {
  const ApplicationHost& application;
  const Modes& modes;
  const Chains& chains;
  const Wiring& wiring;
  const record::Recorder* recorder = nullptr;  ///< Null if nobody records.
};

/// Publishes how the application does on `fastcycle/status`: every `status_period_ms`, and at once
/// when a component's state, health or faults change.
///
/// It comes behind the application's components, made only if somebody subscribes. What it says in
/// simulated time is how things stand when a round is over: the same for any number of workers.
///
/// @threads  As a component.
class StatusComponent final : public Component {
 public:
  explicit StatusComponent(Context& context);

  /// What it tells of; before it starts.
  void set_sources(const StatusSources& sources);

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

  TimeDriver& time_;
  std::optional<StatusSources> sources_;
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

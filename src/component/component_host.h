#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/log.h"
#include "broker/topics.h"
#include "config/description.h"
#include "executor/actor.h"
#include "fastcycle/param_list.h"
#include "fastcycle/params.h"
#include "fastcycle/qos.h"
#include "params/param_table.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class TimeDriver;

/// All components of an application, in the order of its file.
using Components = std::vector<std::unique_ptr<detail::ComponentCore>>;

/// Connects components to topics and disconnects them, for the owner of the topics.
class TopicHost {
 public:
  TopicHost() = default;
  TopicHost(const TopicHost&) = delete;
  TopicHost& operator=(const TopicHost&) = delete;

  /// Control thread before the start and after the end; their names and publishers at any time.
  [[nodiscard]] virtual detail::Topics& topics() = 0;

  // In an activation of `component`.

  /// Subscriptions that come and go while publishers run.
  ///
  /// @errors  std::runtime_error if the topic is of another type.
  virtual detail::CallbackSubscription& subscribe_late(
      detail::ComponentCore& component, const std::string& topic,
      const google::protobuf::Message& default_instance, const SubscriberOptions& options,
      detail::EnvelopeCallback callback) = 0;
  virtual void end_subscription(detail::ComponentCore& component,
                                detail::CallbackSubscription& subscription,
                                detail::DropReason reason) noexcept = 0;
  /// Reconnects an ended subscription, for a component that is reconstructed.
  virtual void reopen_subscription(detail::ComponentCore& component,
                                   detail::CallbackSubscription& subscription) = 0;
  /// Notifies the subscribers of all topics of `component` that it has ended, or is back.
  virtual void report_liveliness(detail::ComponentCore& component, bool is_alive,
                                 std::string_view reason) = 0;

 protected:
  ~TopicHost() = default;
};

/// Ends and starts the threads of a component that is reconstructed, for their owner. In an
/// activation of it.
class ThreadHost {
 public:
  ThreadHost() = default;
  ThreadHost(const ThreadHost&) = delete;
  ThreadHost& operator=(const ThreadHost&) = delete;

  /// Until `start_threads` none begins. Runs the callbacks of their stop tokens.
  virtual void ask_threads_to_end(detail::ComponentCore& component) = 0;
  /// The names of those that have not ended. Safe.
  [[nodiscard]] virtual std::vector<std::string> running_threads(
      const detail::ComponentCore& component) const = 0;
  /// @pre  They have ended.
  virtual void join_threads(const detail::ComponentCore& component) = 0;
  /// Those of its new object; they begin with those of the others, and not after the end began.
  virtual void start_threads(detail::ComponentCore& component) = 0;

 protected:
  ~ThreadHost() = default;
};

/// Interface of the application to a component's core, its context and its service ends.
///
/// @threads  Safe from the start to the end, unless stated otherwise.
class ComponentHost {
 public:
  ComponentHost() = default;
  ComponentHost(const ComponentHost&) = delete;
  ComponentHost& operator=(const ComponentHost&) = delete;

  // Constant once it is built.
  [[nodiscard]] virtual const config::ApplicationDescription& description() const = 0;
  /// The service with this id; "?" if no component provides or calls it.
  [[nodiscard]] virtual std::string service_name(std::uint64_t id) const = 0;

  // Each is safe as documented there.
  [[nodiscard]] virtual TopicHost& wiring() = 0;
  [[nodiscard]] virtual ThreadHost& threads() = 0;
  [[nodiscard]] virtual TimeDriver& time() = 0;
  [[nodiscard]] virtual detail::LogQueue& log_queue() = 0;
  /// Guards the committed parameters of all components.
  [[nodiscard]] virtual ParamMutex& param_mutex() = 0;

  /// When its timers started; before that, when its start began.
  [[nodiscard]] virtual Time start_time() const = 0;
  /// The mode as of the last switch; empty if there are none.
  [[nodiscard]] virtual std::string mode() const = 0;

  // Queries and requests of components, in their activations.

  /// Requests `mode` on behalf of `by`.
  ///
  /// @errors  std::invalid_argument if there is no such mode.
  virtual void ask_mode(std::string_view mode, std::string_view why, detail::ComponentCore& by) = 0;
  /// For `component`; `done` is called in another activation of it.
  virtual void change_params(detail::ComponentCore& component, std::vector<ParamChange> changes,
                             std::function<void(const ParamsResult&)> done) = 0;
  /// Descriptions of the params of all components.
  [[nodiscard]] virtual std::vector<ParamInfo> list_params() const = 0;
  /// Requests a dump of the flight recorder; false if there is none.
  virtual bool dump(std::string_view reason, std::string_view component,
                    std::string_view detail) noexcept = 0;

  // Notifications from components, in their activations.

  /// `component` has another state, health, fault, or, not urgently, another reason for its health.
  virtual void component_changed(detail::ComponentCore& component, bool is_urgent) = 0;
  /// `component` now has the code of another library, or its probation has ended.
  virtual void version_changed(detail::ComponentCore& component) = 0;
  virtual void fault_noted(const detail::ComponentCore& component, std::string_view what) = 0;
  /// It has failed and will not be reconstructed.
  virtual void component_failed(detail::ComponentCore& component) = 0;
  /// Its input has ended.
  virtual void source_finished(detail::ComponentCore& component) = 0;
  /// A publisher, or all publishers of a topic, missed a deadline. In a turn of some component.
  virtual void deadline_missed(const QosEvent& event) = 0;
  /// A message for `sink` was too late for the chain with this index in the file.
  virtual void chain_breached(detail::ComponentCore& sink, std::size_t chain) = 0;
  /// Ends the run: a component failed whose policy requires it.
  virtual void end_by_fault() = 0;
  /// Whether `component` runs in a process of its own that is restarted when it ends.
  [[nodiscard]] virtual bool may_end_process(const detail::ComponentCore& component) const = 0;
  /// Ends this process at once: `component` cannot be recovered otherwise.
  virtual void end_process(detail::ComponentCore& component, const std::string& what) = 0;
  /// Whether `component` runs in another process of the application. Any thread.
  [[nodiscard]] virtual bool runs_elsewhere(const std::string& component) const = 0;

  // Within a constructor.

  /// Declares the publishers of a component that a recording replaces.
  virtual void declare_replayed(detail::ComponentCore& component) = 0;
  /// Whether the published messages are recorded.
  [[nodiscard]] virtual bool is_recorded() const = 0;
  virtual void record(const config::RecordDescription& description) = 0;

 protected:
  ~ComponentHost() = default;
};

}  // namespace fastcycle::host

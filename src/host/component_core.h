#pragma once

#include <atomic>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "config/description.h"
#include "config/params.h"
#include "executor/actor.h"
#include "fastcycle/component.h"
#include "fastcycle/library.h"
#include "fastcycle/service.h"
#include "host/param_table.h"

namespace fastcycle::host {
class Application;
}  // namespace fastcycle::host

namespace fastcycle::detail {

/// One component of an application: its object, what it declared, and what became of it.
///
/// @threads  As `Actor`; what the report reads is read after the end of the run.
class ComponentCore final : public Actor {
 public:
  enum class State : std::uint8_t {
    kDeclared,
    kConstructed,
    kStandby,     ///< Started, not active in the application's mode.
    kActive,      ///< Started; its callbacks come.
    kRestarting,  ///< After a fault it waits to be made anew.
    kStopped,
    kFailed,
  };

  ComponentCore(host::Application& its_application, std::uint32_t its_index,
                config::ComponentDescription its_description, const ComponentClass& its_class,
                const base::Clock& its_clock);
  ~ComponentCore() override;

  /// Makes the component's object. Mistakes in its parameters go to `problems`.
  /// Returns what its constructor threw, or nothing.
  std::optional<std::string> construct(config::Problems& problems);

  /// Destroys the object; what its destructor throws is a fault.
  void destroy();

  /// The lifecycle, each called in an activation.
  void call_start();
  void call_activate();
  void call_deactivate();
  void call_stop();

  /// What is wrong with a `start` that takes longer than it may.
  [[nodiscard]] std::string late_start() const;

  [[nodiscard]] bool has_started() const noexcept {
    return state == State::kStandby || state == State::kActive || state == State::kRestarting;
  }

  /// Makes its object anew, as after a fault, but in order: it is deactivated and stopped before.
  /// In an activation. Returns why that cannot be done; empty if it was, whatever came of it.
  [[nodiscard]] std::string renew();

  /// Puts changed parameters in place; in an activation.
  void take_params(std::uint64_t transaction, const host::ParamValues& values);

  /// Ends the component after a fault: nothing is delivered to it any more.
  void fail(std::string_view what);
  void note_fault(std::string_view what);

  /// The mistakes that show once the constructor ran: parameters, queues and topics that the file
  /// names and nobody declared.
  void check_unused(config::Problems& problems) const;

  [[nodiscard]] std::string topic_name(std::string_view name_in_code) const {
    return config::resolve_topic(description, name_in_code);
  }
  /// The full name of the topic that its code uses as `name_in_code`; adds a mistake if only topics
  /// of services may have it.
  std::string declare_topic(std::string_view name_in_code);
  [[nodiscard]] SubscriberOptions subscriber_options(std::string_view topic,
                                                     SubscriberOptions options) const;

  /// What is declared again, in the same order, when the component is restarted.
  struct Declared {
    std::vector<PublisherCore*> publishers;
    std::vector<CallbackSubscription*> subscriptions;
    std::vector<View*> views;
    std::vector<Synchronizer*> synchronizers;
  };
  /// Takes over what the constructor of a restarted component says of `subscription`, and connects
  /// it again if it had ended.
  void redeclare_subscription(CallbackSubscription& subscription, const SubscriberOptions& options,
                              EnvelopeCallback callback);
  /// Watches over the deadline that `publisher` offers.
  void offer(PublisherCore& publisher, Duration deadline, const QosCallback& on_event);

  struct NamedThread {
    std::string name;
    std::function<void(std::stop_token)> body;
  };

  host::Application& application;
  const config::ComponentDescription description;
  const ComponentClass component_class;
  Context context{*this};
  Component* component = nullptr;
  std::atomic<State> state{State::kDeclared};
  /// How its first `start` goes, between the worker that calls it and who waits for that.
  struct Start {
    enum class Stage : std::uint8_t { kWaiting, kCalled, kReturned, kLate, kDone };
    std::mutex mutex;
    std::condition_variable changed;
    Stage stage = Stage::kWaiting;

    void set(Stage its_stage) {
      const std::lock_guard lock(mutex);
      if (stage != Stage::kLate) {
        stage = its_stage;
      }
      changed.notify_all();
    }
    [[nodiscard]] bool is_late() {
      const std::lock_guard lock(mutex);
      return stage == Stage::kLate;
    }
  } first_start;
  bool is_wanted = true;           ///< The application's mode has it active.
  bool was_active_at_end = false;  ///< When it was stopped.

  // Declarations.
  bool is_constructing = false;
  Declared declared;
  Declared redeclared;  ///< How far a restarted constructor got, by its sizes.
  bool is_redeclaring = false;
  std::set<std::string, std::less<>> topics_in_code;
  std::vector<NamedThread> threads;
  std::vector<std::unique_ptr<OfferedDeadline>> offered;
  host::ParamTable param_table;
  std::unique_ptr<config::ParamReader> params;  ///< While it is constructed.
  std::vector<std::unique_ptr<ClientCore>> clients;
  std::vector<std::unique_ptr<ServerCore>> servers;
  /// Of its servers, one for each client; made when the application is built.
  std::vector<PublisherCore*> service_publishers;
  config::Problems* problems = nullptr;
  std::set<std::string> declared_params;

  /// The request that is served now, or whose answer waits for the call whose reply came now.
  Ticket serving{};

  // What it says of itself and of the run; its own activations only.
  std::map<std::string, ReportValue, std::less<>> results;
  Health health = Health::kOk;
  std::string health_reason;
  std::optional<Random> random;
  std::vector<std::string> faults;  ///< The first 16, in words.
  std::string last_fault;
  std::uint64_t fault_count = 0;
  std::uint64_t restart_count = 0;
  std::uint32_t restarts = 0;  ///< Within the time that began at `first_restart_ns`.
  std::int64_t first_restart_ns = 0;

  // A source that has not finished keeps the run going.
  std::atomic<bool> is_source{false};
  std::atomic<bool> is_source_finished{false};

 protected:
  void on_fault(std::string_view what) override;
  void on_breach(std::size_t chain) override;

 private:
  void activate_now();
  void check_params(config::Problems& its_problems) const;
  [[nodiscard]] std::string inactive() const;
  void restart(std::string_view what);
  void make_anew();
  /// From now on what it publishes reaches nobody, that of its threads included; or does again.
  void mute(bool is_muted);
  /// Its object is gone: nobody waits for its calls, and nobody else can give the answers it owes.
  void end_calls(std::string_view what);
  /// The application stops, or the component is deactivated: what it owes and what it awaits ends
  /// with that.
  void end_services(CallStatus owed, CallStatus awaited, std::string_view reason);
  /// Ends the subscriptions of the old object that must not go on as they are.
  void end_old_subscriptions();
  /// Ends what it subscribed to in its callbacks.
  void end_late_subscriptions();
  [[nodiscard]] bool is_redeclared() const noexcept;

  const char* in_call_ = nullptr;  ///< What it was, in words, if it throws.
};

}  // namespace fastcycle::detail

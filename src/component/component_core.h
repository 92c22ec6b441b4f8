#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/priority_mutex.h"
#include "broker/offered_deadline.h"
#include "component/bell.h"
#include "component/component_state.h"
#include "component/service_end.h"
#include "component/versions.h"
#include "config/description.h"
#include "config/params.h"
#include "executor/activation.h"
#include "executor/actor.h"
#include "executor/life_step.h"
#include "fastcycle/component.h"
#include "fastcycle/library.h"
#include "fastcycle/service.h"
#include "params/param_table.h"

namespace fastcycle::host {
class ComponentHost;
}  // namespace fastcycle::host

namespace fastcycle::detail {

class Reloading;

/// One component of an application: owns its object, its declarations, and its results.
///
/// @threads  As `Actor`; the report reads it after the end of the run.
class ComponentCore final : public Actor {
 public:
  using State = ComponentState;

  ComponentCore(host::ComponentHost& its_application, std::uint32_t its_index,
                config::ComponentDescription its_description, const ComponentClass& its_class,
                const base::Clock& its_clock);
  ~ComponentCore() override;

  /// Constructs the component's object. Errors in its parameters go to `problems`. Returns what its
  /// constructor threw, or nothing.
  std::optional<std::string> construct(config::Problems& problems);

  /// Destroys the object; an exception of its destructor is a fault.
  void destroy();

  /// The lifecycle, each called in an activation.
  void call_start();
  /// All have started, as of `start`.
  void begin_timers(Time start);
  void call_activate();
  void call_deactivate();
  void call_stop();

  /// The params of its present object, without the shared ones.
  [[nodiscard]] const config::Value& own_params() const {
    return versions->params() != nullptr ? *versions->params() : description.params;
  }

  /// Describes a `start` that exceeds its limit.
  [[nodiscard]] std::string late_start() const;

  /// The life cycle call that is running, such as "its start()"; null if none. Safe.
  [[nodiscard]] const char* call_in_words() const noexcept { return in_call_.load(); }

  /// How often it was reconstructed, after faults or on request; reloads do not count.
  [[nodiscard]] std::uint64_t renewals() const noexcept {
    return restart_count - versions->exchanges();
  }

  [[nodiscard]] bool has_started() const noexcept {
    return state == State::kStandby || state == State::kActive || state == State::kRestarting;
  }

  /// Reconstructs an object that was not started, with the state that it received meanwhile, and
  /// starts it. In an activation.
  void begin_anew();
  /// Reconstructs its object, as after a fault, but orderly: it is deactivated and stopped before.
  /// In an activation. Returns why that cannot be done; empty if it was, whatever the result, or
  /// will be, once its threads have ended.
  [[nodiscard]] std::string renew();
  /// Executes a tool's request: `kRenew`, `kToolStop`, `kToolStart`, `kRollBack` or `kConfirm`.
  /// Returns as `renew`.
  [[nodiscard]] std::string obey(LifeStep step);

  /// Applies changed parameters; in an activation. `text` is their form in a log.
  void take_params(std::uint64_t transaction, const host::ParamValues& values,
                   const std::string& text);
  /// The keys of activations by cause parameter in the log of a run: of new values, the number of
  /// the transaction; of the answer to a change that the component requested, this and its number.
  static constexpr std::uint64_t kParamsAsked = std::uint64_t{1} << 63U;

  /// A fault of its object number `object` that comes from outside of its callbacks: a thread of
  /// its own threw, or the fault is injected. An activation of its own takes it. Safe.
  void post_fault(std::uint64_t object, const std::string& what);
  /// As `object`: the one that is there when the fault is taken.
  static constexpr std::uint64_t kAnyObject = (std::uint64_t{1} << 63U) - 1;
  /// In that activation. It becomes a fault of the component, unless it was reconstructed since.
  void take_fault_of_thread(std::uint64_t object, const std::string& what);
  /// The keys of faults in the log of a run: of threads and injected ones, by the number of the
  /// object; of offloaded work, by its own; of a service that released a request unanswered, 0.
  static constexpr std::uint64_t kThreadFault = std::uint64_t{1} << 63U;
  [[nodiscard]] static constexpr std::uint64_t fault_key_of_thread(std::uint64_t object) {
    return kThreadFault | object;
  }

  /// Fails the component after a fault: nothing is delivered to it any more.
  void fail(std::string_view what);
  void note_fault(std::string_view what);

  /// Reports errors that are found after the constructor: parameters, queues and topics that the
  /// file names and the component did not declare.
  void check_unused(config::Problems& problems) const;

  [[nodiscard]] std::string topic_name(std::string_view name_in_code) const {
    return config::resolve_topic(description, name_in_code);
  }
  /// The full name of the topic that its code uses as `name_in_code`; adds an error if it is
  /// reserved for topics of services.
  std::string declare_topic(std::string_view name_in_code);
  [[nodiscard]] SubscriberOptions subscriber_options(std::string_view topic,
                                                     SubscriberOptions options) const;

  /// Declarations that are repeated, in the same order, when the component is restarted.
  struct Declared {
    std::vector<PublisherCore*> publishers;
    std::vector<CallbackSubscription*> subscriptions;
    std::vector<View*> views;
    std::vector<Synchronizer*> synchronizers;
  };
  /// Applies the new options of `subscription` from the constructor of a restarted component, and
  /// connects it again if it had ended.
  void redeclare_subscription(CallbackSubscription& subscription, const SubscriberOptions& options,
                              EnvelopeCallback callback);
  /// Monitors the deadline that `publisher` offers.
  void offer(PublisherCore& publisher, Duration deadline, const QosCallback& on_event);

  struct NamedThread {
    std::string name;
    std::function<void(std::stop_token)> body;
  };

  host::ComponentHost& application;
  const config::ComponentDescription description;

  /// Describes the call that exceeds its limit; empty if none does. Safe.
  [[nodiscard]] std::string hang() const {
    const std::lock_guard lock(hang_mutex_);
    return hang_;
  }
  void set_hang(std::string hang) {
    const std::lock_guard lock(hang_mutex_);
    hang_ = std::move(hang);
  }

  ComponentClass component_class;  ///< Of its present object; see `versions`.
  Context context{*this};
  LogSource log_source;
  Component* component = nullptr;
  std::atomic<State> state{State::kDeclared};
  /// When the application's timers started; none before. Its own activations only.
  std::optional<Time> timers_began;
  /// Progress of its first `start`, shared by the worker that calls it and the thread that waits.
  class Start {
   public:
    enum class Stage : std::uint8_t { kWaiting, kCalled, kReturned, kLate };

    host::Bell* bell = nullptr;  ///< Notifies the waiting thread; set before the call.

    [[nodiscard]] Stage stage() const noexcept { return stage_.load(); }
    [[nodiscard]] bool is_late() const noexcept { return stage() == Stage::kLate; }
    /// Why the wait was given up. @pre `is_late()`
    [[nodiscard]] const std::string& why() const noexcept { return why_; }

    /// By its worker. Once it is late it stays so.
    void set(Stage next) noexcept {
      Stage now = stage();
      while (now != Stage::kLate && !stage_.compare_exchange_weak(now, next)) {
      }
      if (bell != nullptr) {
        bell->ring();
      }
    }
    /// Called by the waiting thread. False if the call has returned.
    bool expire(std::string why) {
      why_ = std::move(why);
      Stage now = stage();
      while (now == Stage::kWaiting || now == Stage::kCalled) {
        if (stage_.compare_exchange_weak(now, Stage::kLate)) {
          return true;
        }
      }
      return false;
    }

   private:
    std::atomic<Stage> stage_{Stage::kWaiting};
    std::string why_;
  } first_start;
  bool is_stuck = false;           ///< After the stop: a call of its code has not returned.
  bool is_left_alone = false;      ///< After the stop: a thread may still be in its code.
  bool is_wanted = true;           ///< It is active in the application's mode.
  bool was_active_at_end = false;  ///< When it was stopped.

  // Declarations.
  bool is_constructing = false;
  Declared declared;
  Declared redeclared;       ///< How far a restarted constructor got, by its sizes.
  bool is_recorder = false;  ///< It records all that is published.
  bool is_redeclaring = false;
  std::set<std::string, std::less<>> topics_in_code;
  std::vector<NamedThread> threads;       ///< Not changed while one of them runs.
  std::vector<std::string> timer_labels;  ///< By number, once it was constructed.
  std::atomic<int> jobs{0};               ///< Offloaded jobs that are running.
  std::uint64_t jobs_made = 0;            ///< All jobs ever offloaded; its own activations only.
  std::uint64_t jobs_ended = 0;           ///< Those whose completion it served.
  std::uint64_t params_asked = 0;         ///< Changes of params ever requested.
  std::uint64_t params_answered = 0;      ///< Those whose answer it served.
  std::vector<std::unique_ptr<OfferedDeadline>> offered;
  host::ParamTable param_table;
  std::unique_ptr<KeyFrames> states;            ///< `DeclaredStates`; null if it declared none.
  std::unique_ptr<config::ParamReader> params;  ///< While it is constructed.
  std::vector<std::unique_ptr<ServiceEnd>> clients;  ///< Each is a `ClientCore`,
  std::vector<std::unique_ptr<ServiceEnd>> servers;  ///< and each of these a `ServerCore`.
  /// Of its servers, one for each client; made when the application is built.
  std::vector<PublisherCore*> service_publishers;
  config::Problems* problems = nullptr;
  std::set<std::string> declared_params;

  /// The request being served, or the one whose answer waits for the call that was replied to now.
  Ticket serving{};

  // What it reports of itself and of the run; its own activations only.
  std::map<std::string, ReportValue, std::less<>> results;
  Health health = Health::kOk;
  std::string health_reason;
  std::optional<Random> random;
  std::vector<std::string> faults;  ///< The first 16, as text.
  std::string last_fault;
  std::uint64_t fault_count = 0;
  std::uint64_t restart_count = 0;     ///< Identifies its objects; not changed while threads run.
  std::unique_ptr<Versions> versions;  ///< `Reloading`; set once it is made.
  std::uint32_t restarts = 0;          ///< Within the time that began at `first_restart_ns`.
  std::int64_t first_restart_ns = 0;

  // A source that has not finished keeps the run going.
  std::atomic<bool> is_source{false};
  std::atomic<bool> is_source_finished{false};

 protected:
  void on_fault(std::string_view what) override;
  void on_breach(std::size_t chain) override;
  void on_qos_event(const Watch& watch, const QosEvent& event) override;

 private:
  friend class Reloading;

  void activate_now();
  void check_params(config::Problems& its_problems) const;
  [[nodiscard]] std::string inactive() const;
  void restart(std::string_view what);
  /// Its restarts are used up: applies `then` of their description.
  void escalate(std::string_view what);
  /// Requests the object's threads to end, and calls `next` once they have: at once if there are
  /// none; live, after waiting suspended. Fails if one of them takes too long.
  void end_threads(const std::function<void()>& next);
  void await_threads(std::int64_t deadline_ns, const std::function<void()>& next);
  /// Destroys the object, and reconstructs it after `delay`.
  void replace(std::chrono::nanoseconds delay);
  /// Destroys the object, and what depends on it. Messages held by synchronizers are kept.
  void end_object();
  /// Constructs the object, as after `end_object`, and starts it. Returns why that failed, or
  /// nothing.
  [[nodiscard]] std::string try_anew();
  /// The same; the component has failed if that fails.
  void make_anew();
  /// Records a fault without effect on the application.
  void note_contained_fault(std::string_view what);
  /// Suppresses all that it and its threads publish, or ends that.
  void mute(bool is_muted);
  /// Its object is gone: ends its open calls and its pending requests.
  void end_calls(std::string_view what);
  /// The application stops, or the component is deactivated: ends its pending requests and open
  /// calls.
  void end_services(CallStatus owed, CallStatus awaited, std::string_view reason);
  /// Ends the subscriptions of the old object that cannot be kept.
  void end_old_subscriptions();
  /// Ends the subscriptions made in its callbacks.
  void end_late_subscriptions();
  [[nodiscard]] bool is_redeclared() const noexcept;

  /// The running call as text, for one that throws or does not return. Written by its worker.
  NotedCall in_call_;
  /// While it is replaced, its messages wait until it is active again.
  bool keeps_messages_ = false;
  bool owes_stop_ = false;  ///< It is reconstructed orderly, and `stop` was not called yet.

  mutable base::PriorityMutex hang_mutex_;
  std::string hang_;
};

}  // namespace fastcycle::detail

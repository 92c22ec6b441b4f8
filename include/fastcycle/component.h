#pragma once

#include <algorithm>
#include <chrono>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <stop_token>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "fastcycle/detail/callback.h"
#include "fastcycle/log.h"
#include "fastcycle/message.h"
#include "fastcycle/params.h"
#include "fastcycle/publisher.h"
#include "fastcycle/qos.h"
#include "fastcycle/sample.h"
#include "fastcycle/state.h"
#include "fastcycle/subscriber.h"
#include "fastcycle/time.h"
#include "fastcycle/timer.h"
#include "fastcycle/views.h"

namespace fastcycle {

struct SynchronizerOptions;
// Defined in service.h and action.h.
template <Message Request, Message T>
class Client;
struct ClientOptions;
struct ServiceOptions;
template <Message Goal, Message Feedback, Message Result>
class ActionClient;
struct ActionServerOptions;

/// A component's own assessment of its health.
enum class Health : std::uint8_t { kOk, kDegraded, kFailed };

/// The value of one result that a component reports.
using ReportValue = std::variant<bool, std::int64_t, double, std::string>;

/// The generator behind `Component::random`, seeded from the application's and the component's
/// name: every run draws the same numbers.
using Random = std::mt19937_64;

/// Options of one publisher. The queue length is an option of each subscriber: `depth`
/// (`SubscriberOptions`, or `"subscribers"` in the application file).
template <Message T>
struct PublisherOptions {
  /// Presizes every message of the pool when the topic is connected, so that the first publishes
  /// cause no page fault and no allocation. Only its capacity is used: `loan` returns empty
  /// messages.
  std::optional<T> prototype = {};
  /// Longest time between two messages that this publisher promises. Each violation is counted and
  /// reported as an event to its own component.
  std::optional<Duration> deadline = {};
  /// Called with the events of this publisher.
  QosCallback on_event = {};
  /// Flow control for a source that must lose nothing: the number of messages that may be queued at
  /// each subscriber; `credits()` returns how many more may be published. At most the smallest
  /// `depth` of the subscribers; 0 disables it. `"topics"` in the application file overrides it.
  std::size_t credits = 0;
  /// Called, with the cause `event`, when credits are available again after they were used up. Not
  /// for external publishers, which wait in `wait_for_credit`.
  std::function<void()> on_credits = {};
};

namespace detail {

class ComponentCore;

/// The payload is passed with its envelope, so that the envelope need not be read for it.
using EnvelopeCallback = std::function<void(Envelope&, const google::protobuf::Message&)>;
using TickCallback = std::function<void(const Tick&)>;

/// The slot of a parameter, with its value; a component that is constructed again keeps its slots.
ParamSlot& declare_param(ComponentCore& core, std::unique_ptr<ParamSlot> slot);
void set_on_change(ComponentCore& core, const ParamSlot& slot, std::function<void()> callback);
PublisherCore& create_publisher(ComponentCore& core, std::string_view topic,
                                const google::protobuf::Message& default_instance,
                                const google::protobuf::Message* prototype, bool is_external);
google::protobuf::Message& declare_state(ComponentCore& core, std::string_view name,
                                         const google::protobuf::Message& default_instance,
                                         std::function<void(google::protobuf::Message&)> save);
Subscription& create_subscription(ComponentCore& core, std::string_view topic,
                                  const google::protobuf::Message& default_instance,
                                  const SubscriberOptions& options, EnvelopeCallback callback);
Holder holder_of(const Subscription& subscription) noexcept;
View& create_view(ComponentCore& core, std::string_view topic,
                  const google::protobuf::Message& default_instance, std::size_t depth,
                  std::optional<Duration> span);
/// Monitors the deadline that the code, or the application file, sets for `publisher`.
void watch_publisher(ComponentCore& core, PublisherCore& publisher, std::string_view topic,
                     std::optional<Duration> deadline, const QosCallback& on_event);
TimerCore& create_timer(ComponentCore& core, const TimerOptions& options, TickCallback callback);

/// Sets the credit window of `publisher`, if it has one.
void use_credits(ComponentCore& core, PublisherCore& publisher, std::size_t window,
                 std::function<void()> on_credits);

template <typename F>
TickCallback tick_callback(F callback) {
  if constexpr (std::invocable<F&, const Tick&>) {
    return TickCallback(std::move(callback));
  } else {
    return [callback = std::move(callback)](const Tick&) mutable { callback(); };
  }
}

}  // namespace detail

namespace detail {

/// The types that `Component::observe` may return.
template <typename T>
concept Observable = std::same_as<T, std::string> || Message<T> || std::is_trivially_copyable_v<T>;

/// In a replay, the value that the recorded activation observed under this name; else none.
/// Rethrows a recorded exception as a `std::runtime_error`.
[[nodiscard]] std::optional<std::string> take_observed(ComponentCore& core, std::string_view name);
/// Records the value if the run is recorded.
void keep_observed(ComponentCore& core, std::string_view name, std::string_view bytes);
/// The same for the exception that is being handled.
void keep_failed_observation(ComponentCore& core, std::string_view name);

template <Observable T>
std::string to_observed(const T& value) {
  if constexpr (std::same_as<T, std::string>) {
    return value;
  } else if constexpr (Message<T>) {
    return value.SerializeAsString();
  } else {
    return std::string(reinterpret_cast<const char*>(&value), sizeof(T));
  }
}

template <Observable T>
T from_observed(const std::string& bytes) {
  if constexpr (std::same_as<T, std::string>) {
    return bytes;
  } else if constexpr (Message<T>) {
    T value;
    static_cast<void>(value.ParseFromString(bytes));
    return value;
  } else {
    T value{};
    std::memcpy(&value, bytes.data(), std::min(bytes.size(), sizeof(T)));
    return value;
  }
}

}  // namespace detail

/// A callback for messages: `f(const T&)`, or `f(const Sample<T>&)` to see its info or to keep it.
/// Not `f(T)`, which would copy each message.
template <typename F, typename T>
concept MessageCallback = std::invocable<F&, const T&> || std::invocable<F&, const Sample<T>&>;

/// A callback for timers: `f()` or `f(const Tick&)`.
template <typename F>
concept TimerCallback = std::invocable<F&> || std::invocable<F&, const Tick&>;

/// A callback for changes of a parameter: `f(const T&)` with the new value, or `f()`.
template <typename F, typename T>
concept ParamCallback = std::invocable<F&, const T&> || std::invocable<F&>;

/// Declares that a component produces input until it calls `finish`. The run ends when every source
/// of the application has finished; an application without sources runs until it is stopped.
///
/// @threads  Safe.
class Source {
 public:
  /// Constructed by `Context::create_source`.
  explicit Source(detail::ComponentCore& core) : core_(&core) {}

  /// Reports that this component has no more input. A second call does nothing.
  void finish();

 private:
  detail::ComponentCore* core_;
};

/// Keeps simulated time from advancing while it exists: for threads that publish from outside.
///
/// @threads  Safe to hold and to destroy on any thread.
class TimeHold {
 public:
  /// Constructed by `Context::hold_time`.
  explicit TimeHold(detail::ComponentCore& core);
  /// Takes the hold over.
  TimeHold(TimeHold&& other) noexcept : core_(std::exchange(other.core_, nullptr)) {}
  TimeHold(const TimeHold&) = delete;
  TimeHold& operator=(const TimeHold&) = delete;
  TimeHold& operator=(TimeHold&&) = delete;
  ~TimeHold();

 private:
  detail::ComponentCore* core_;
};

/// The interface through which a component declares its parameters, topics and timers.
///
/// Everything is declared in the constructor; errors (a missing parameter, a wrong type, a topic
/// with two types) are collected, and the application does not start. Subscriptions may also be
/// created later, in an activation of the component.
///
/// @threads  Confined to its component: its constructor and its activations.
/// @realtime Allocates: not for use on a hot path.
class Context {
 public:
  /// Constructed by FastCycle, which passes it to the component's constructor.
  explicit Context(detail::ComponentCore& core) : core_(core) {}
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  /// The component's name in the application, with its namespace: "front/limiter".
  [[nodiscard]] const std::string& component_name() const;
  /// The application's name, from its file.
  [[nodiscard]] const std::string& application_name() const;

  /// Declares the parameter `name` (dots reach into objects: "limits.jerk"). Its value is the
  /// configured one, else that of the same name in `"shared_params"`, else the fallback.
  ///
  /// @errors  A missing value, a wrong type or a value out of range is a start-up error; the
  ///          parameter then has its fallback, or an empty value.
  template <ParamType T>
  [[nodiscard]] Param<T> param(std::string_view name, ParamOptions<T> options = {});

  /// Calls `callback` when `param`, which is tunable, was changed at run time: in the activation
  /// that applies the new value, after all other changes of that transaction. An exception from it
  /// is a fault of the component. Not called before `start`; one callback per parameter.
  template <ParamType T, ParamCallback<T> F>
  void on_change(const Param<T>& param, F callback);

  /// Registers `check` to validate the parameters together: the configured values after the
  /// constructor, and each transaction before it is applied. A rejection is an error like one of
  /// type or range, and nothing is changed.
  ///
  /// @threads  `check` runs on the thread that requests a change, while others wait: it may use
  ///           only its argument, and must not touch the component.
  void check_params(ParamCheck check);

  /// Requests a transaction over parameters of any components: all values are checked first, and
  /// all are changed, or none. Each component applies its new values between two of its
  /// activations; with simulated time all of them do so in the next round. `done`, if given, is an
  /// activation of this component, with the cause `parameter`, and receives the result.
  ///
  /// @pre  Called in an activation.
  void change_params(std::vector<ParamChange> changes,
                     std::function<void(const ParamsResult&)> done = {});

  /// Declares that the component publishes on `topic`. Topic names in code are relative:
  /// `"namespace"` and `"remap"` of the component resolve them.
  template <Message T>
  [[nodiscard]] Publisher<T> create_publisher(std::string_view topic,
                                              const PublisherOptions<T>& options = {});

  /// Declares that a thread outside of FastCycle publishes on `topic`.
  template <Message T>
  [[nodiscard]] ExternalPublisher<T> create_external_publisher(
      std::string_view topic, const PublisherOptions<T>& options = {});

  /// Declares state that FastCycle keeps for the component; see `State`. `name` is of a-z, 0-9 and
  /// _.
  template <Message T>
  [[nodiscard]] State<T> state(std::string_view name) {
    return State<T>(
        static_cast<T&>(detail::declare_state(core_, name, T::default_instance(), nullptr)));
  }
  /// The same for a component that keeps its state in another form: `save`, called as `f(T&)` with
  /// an empty message, writes the state to it: for a key frame, after a callback; and before the
  /// object is replaced. The constructor restores the state from the message:
  ///
  ///     : state_(context.state<demo::Estimate>("estimate", [this](auto& state) { save(state); }))
  ///     {
  ///       load(*state_);
  ///     }
  template <Message T, std::invocable<T&> F>
  [[nodiscard]] State<T> state(std::string_view name, F save) {
    return State<T>(static_cast<T&>(
        detail::declare_state(core_, name, T::default_instance(),
                              [save = std::move(save)](google::protobuf::Message& message) mutable {
                                save(static_cast<T&>(message));
                              })));
  }

  /// Calls `callback` with every message of `topic`, in the order in which messages were published
  /// across all topics of this component, and never at the same time as another of its callbacks.
  ///
  /// A callback takes `const T&`, or `const Sample<T>&` to keep the message without a copy. One
  /// that takes `T`, or has `auto copy = message;`, copies every byte of each message: for a large
  /// one that costs more than the rest of its delivery. A `const T&` is valid until the callback
  /// returns: a pointer or a reference to it, or to a part of it, must not be kept.
  ///
  /// The subscription lasts as long as the component; kept as a `Subscriber` it can end earlier.
  template <Message T, MessageCallback<T> F>
  Subscribed create_subscriber(std::string_view topic, F callback) {
    return create_subscriber<T>(topic, SubscriberOptions{}, std::move(callback));
  }
  /// As above, with options for its queue and its quality of service.
  template <Message T, MessageCallback<T> F>
  Subscribed create_subscriber(std::string_view topic, const SubscriberOptions& options,
                               F callback);

  /// Calls `callback` with one message of each of 2 to 4 topics that belong together: taken at the
  /// same time, at about the same time, or the newest of each (see `SyncPolicy`).
  ///
  ///     context.create_synchronizer<demo::Image, demo::Scan>(
  ///         {"camera/image", "lidar/scan"},
  ///         {.policy = SyncPolicy::kApproximate, .max_difference = 10ms},
  ///         [this](const demo::Image& image, const demo::Scan& scan) {…});
  ///
  /// What the callback publishes inherits the oldest origin of the set. A message without a partner
  /// is counted as `dropped{unmatched}` of its subscription, and one that still waits as queued.
  ///
  /// @errors  A topic that is named twice, a `depth` of zero, or a `max_difference` that does not
  ///          fit the policy is a start-up error.
  template <Message... T, std::size_t N, typename F>
  void create_synchronizer(const std::string_view (&topics)[N], const SynchronizerOptions& options,
                           F callback);

  /// Access to the newest message of `topic`, without callbacks.
  template <Message T>
  [[nodiscard]] Latest<T> create_latest(std::string_view topic);

  /// Access to the last messages of `topic`, without callbacks.
  template <Message T>
  [[nodiscard]] History<T> create_history(std::string_view topic, const HistoryOptions& options);

  /// Calls `callback` periodically, beside the Serve Timer.
  template <TimerCallback F>
  Timer create_timer(const TimerOptions& options, F callback) {
    return Timer(detail::create_timer(core_, options, detail::tick_callback(std::move(callback))));
  }
  /// A one-shot timer: `callback` is called at the time set by `Timer::arm_at`.
  template <TimerCallback F>
  [[nodiscard]] Timer create_timer(F callback) {
    return Timer(detail::create_timer(core_, {}, detail::tick_callback(std::move(callback))));
  }

  /// Declares that the component calls the service `name`; see `Client`. A second client of that
  /// service in this component is the same one. Names are resolved as those of topics.
  template <Message Request, Message T>
  [[nodiscard]] Client<Request, T> create_client(std::string_view name);
  /// As above, with a limit of open calls.
  template <Message Request, Message T>
  [[nodiscard]] Client<Request, T> create_client(std::string_view name,
                                                 const ClientOptions& options);

  /// Answers the requests to the service `name`: at once, by `f(const Request&, Reply&)`, or later,
  /// by `f(const Request&, Responder<Reply>)`; see `Responder`. Each request is an activation.
  template <Message Request, Message T, typename F>
  void create_service(std::string_view name, F callback);
  /// As above, with a limit of pending requests.
  template <Message Request, Message T, typename F>
  void create_service(std::string_view name, const ServiceOptions& options, F callback);

  /// Declares that the component sends goals to the action `name`; see `ActionClient`.
  template <Message Goal, Message Feedback, Message Result>
  [[nodiscard]] ActionClient<Goal, Feedback, Result> create_action_client(std::string_view name);
  /// As above, with a limit of open goals.
  template <Message Goal, Message Feedback, Message Result>
  [[nodiscard]] ActionClient<Goal, Feedback, Result> create_action_client(
      std::string_view name, const ClientOptions& options);

  /// Serves the goals of the action `name`: `f(const Goal&, ServerGoal<Feedback, Result>)` keeps
  /// the goal, or rejects it; see `ServerGoal`.
  template <Message Goal, Message Feedback, Message Result, typename F>
  void create_action_server(std::string_view name, F on_goal);
  /// As above, with a limit of goals, and a callback for cancellation.
  template <Message Goal, Message Feedback, Message Result, typename F>
  void create_action_server(std::string_view name, const ActionServerOptions& options, F on_goal);

  /// Runs `body` on a thread of its own from `start` on, for drivers that must wait for a device.
  /// At the end of the run its `stop_token` requests a stop; it has a second to end before `stop`
  /// is called, which may close the device that it waits for, and is joined after that. An
  /// exception that leaves it is a fault of the component; a restart requests a stop too, and joins
  /// it first. It publishes by an `ExternalPublisher`.
  ///
  /// @errors  A name longer than 15 bytes is cut, which is the limit of the system.
  void create_thread(std::string name, std::function<void(std::stop_token)> body);

  /// Runs `work` on the workers of `executor` beside the component's callbacks, then `done` as an
  /// activation of the component. `work` may use only its captures, and must not touch the
  /// component. A fault in `work` is a fault of the component. At most 1024 jobs of an executor
  /// wait; one more is a fault.
  ///
  /// @pre  Called in an activation.
  void offload(std::string_view executor, std::function<void()> work, std::function<void()> done);

  /// Declares that this component is a source of input; see `Source`.
  [[nodiscard]] Source create_source();

  /// Keeps simulated time from advancing until the hold is destroyed; no effect with the clock
  /// `live`.
  [[nodiscard]] TimeHold hold_time() { return TimeHold(core_); }

  /// Makes the flight recorder write the last seconds, and the next few, to a file that is named
  /// after `reason`: "hard braking". Does nothing if the application has no flight recorder.
  ///
  /// @threads  Safe.
  /// @realtime No lock, no allocation, no system call. With several processes, those other than the
  /// main one send it a request: they lock, allocate and make a system call.
  void dump_flight_recorder(std::string_view reason);

  /// Requests a switch to the mode `mode`: the components that the application file lists for it
  /// become active, and those that it lists for other modes only become inactive, all at one
  /// instant. The switch is asynchronous; in simulated time it takes effect in the next round.
  /// Switches are executed in the order of the requests; one to the mode that the last of them
  /// leads to is ignored. At most 64 wait; more are rejected and counted. `why` is part of the
  /// report.
  ///
  /// @pre     Called in an activation.
  /// @errors  std::invalid_argument if the application has no such mode.
  void switch_mode(std::string_view mode, std::string_view why = {});

  /// The mode that the application is in; empty if its file has no `"modes"`. In a live run it may
  /// change while a callback runs.
  [[nodiscard]] std::string mode() const;

  /// Adds a result of the run to the final table and the report. A later value replaces an earlier
  /// one.
  void report(std::string_view name, ReportValue value);

  /// For the library's own templates.
  [[nodiscard]] detail::ComponentCore& core() noexcept { return core_; }

 private:
  detail::ComponentCore& core_;
};

/// One unit of an application: parameters, topics, callbacks, and one Serve Timer.
///
/// Constructors only declare. A component's callbacks, its timers, `start`, `activate`, `serve`,
/// `deactivate` and `stop` never overlap: it needs no mutex. An exception that leaves one of them
/// is a fault of this component, handled as configured by `"on_fault"`.
///
/// @threads  Everything is called by one worker at a time; which one may change between calls.
class Component {
 public:
  /// `context` outlives the component.
  explicit Component(Context& context) : context_(context) {}
  Component(const Component&) = delete;
  Component& operator=(const Component&) = delete;
  virtual ~Component() noexcept(false) = default;

  /// Acquires devices and files. Called once, before the component's first message, in the order of
  /// the application file, but after the components listed under `"after"`.
  virtual void start() {}

  /// Called before messages and timers are served: after `start`, unless the component is inactive
  /// in the application's mode, and whenever a switch to another mode makes it active. Periodic
  /// timers begin when it returns.
  virtual void activate() {}

  /// Called when a switch to another mode makes the component inactive, and before `stop`. What it
  /// publishes here is still delivered; after it no message and no timer is served until the next
  /// `activate`. All its timers are cancelled.
  virtual void deactivate() {}

  /// The Serve Timer, called every `"serve_period_ms"`; never, if that is not configured.
  virtual void serve() {}

  /// Releases what `start` acquired, reports results. Called once, in the reverse order of the
  /// starts, after the last message; not called after a fault.
  virtual void stop() {}

 protected:
  /// The time of this activation: it does not move while a callback runs.
  [[nodiscard]] Time now() const;
  /// When the application's timers started; in `start()` the time of its activation.
  [[nodiscard]] Time start_time() const;
  /// The component's log.
  [[nodiscard]] Log log() const;
  /// The component's own generator; see `Random`.
  [[nodiscard]] Random& random();

  /// Returns the result of `f`, which reads something from outside that a replay could not
  /// reproduce: a device, a file that changes, another clock. If the run is recorded, the log keeps
  /// the result under this name; a replay returns it from there and does not call `f`.
  ///
  /// The result is a string, a protobuf message, or trivially copyable. A log keeps at most some 2
  /// KB for one activation: more is counted as lost. Of an exception of `f` the text is kept, and
  /// thrown again as a `std::runtime_error`.
  ///
  /// @errors  Not in a constructor, which no recorded run has: that ends the process with a
  /// message.
  template <std::invocable F>
    requires detail::Observable<std::invoke_result_t<F&>>
  auto observe(std::string_view name, F f) {
    using T = std::invoke_result_t<F&>;
    if (const auto bytes = detail::take_observed(context_.core(), name)) {
      return detail::from_observed<T>(*bytes);
    }
    try {
      T value = f();
      detail::keep_observed(context_.core(), name, detail::to_observed(value));
      return value;
    } catch (...) {
      detail::keep_failed_observation(context_.core(), name);
      throw;
    }
  }

  /// Adds a result of the run to the final table and the report (`results`).
  void report(std::string_view name, ReportValue value) { context_.report(name, std::move(value)); }

  /// Sets the component's health; shown in the final table and the report.
  void health(Health state, std::string_view reason = {});

  /// The constructor's context, for calls in activations.
  [[nodiscard]] Context& context() noexcept { return context_; }

 private:
  Context& context_;
};

template <ParamType T>
Param<T> Context::param(std::string_view name, ParamOptions<T> options) {
  auto slot = std::make_unique<detail::ParamSlotOf<T>>(name, std::move(options));
  return Param<T>(
      static_cast<detail::ParamSlotOf<T>&>(detail::declare_param(core_, std::move(slot))));
}

template <ParamType T, ParamCallback<T> F>
void Context::on_change(const Param<T>& param, F callback) {
  const detail::ParamSlotOf<T>& slot = param.slot();
  if constexpr (std::invocable<F&, const T&>) {
    detail::set_on_change(
        core_, slot, [&slot, callback = std::move(callback)]() mutable { callback(slot.value()); });
  } else {
    detail::set_on_change(core_, slot, std::move(callback));
  }
}

template <Message T>
Publisher<T> Context::create_publisher(std::string_view topic, const PublisherOptions<T>& options) {
  detail::PublisherCore& publisher =
      detail::create_publisher(core_, topic, T::default_instance(),
                               options.prototype ? &*options.prototype : nullptr, false);
  detail::watch_publisher(core_, publisher, topic, options.deadline, options.on_event);
  detail::use_credits(core_, publisher, options.credits, options.on_credits);
  return Publisher<T>(publisher);
}

template <Message T>
ExternalPublisher<T> Context::create_external_publisher(std::string_view topic,
                                                        const PublisherOptions<T>& options) {
  detail::PublisherCore& publisher = detail::create_publisher(
      core_, topic, T::default_instance(), options.prototype ? &*options.prototype : nullptr, true);
  detail::watch_publisher(core_, publisher, topic, options.deadline, options.on_event);
  detail::use_credits(core_, publisher, options.credits, options.on_credits);
  return ExternalPublisher<T>(publisher);
}

template <Message T, MessageCallback<T> F>
Subscribed Context::create_subscriber(std::string_view topic, const SubscriberOptions& options,
                                      F callback) {
  FASTCYCLE_REFUSE_COPIED_MESSAGE(F);
  detail::EnvelopeCallback erased;
  std::shared_ptr<detail::Holder> holder;  // Set once the subscription exists.
  if constexpr (std::invocable<F&, const Sample<T>&>) {
    holder = std::make_shared<detail::Holder>(detail::kNobody);
    erased = [callback = std::move(callback), holder](detail::Envelope& envelope,
                                                      const google::protobuf::Message&) mutable {
      callback(detail::share<T>(envelope, *holder));
    };
  } else {
    erased = [callback = std::move(callback)](detail::Envelope&,
                                              const google::protobuf::Message& payload) mutable {
      callback(static_cast<const T&>(payload));
    };
  }
  detail::Subscription& subscription =
      detail::create_subscription(core_, topic, T::default_instance(), options, std::move(erased));
  if (holder != nullptr) {
    *holder = detail::holder_of(subscription);
  }
  return Subscribed(subscription);
}

template <Message T>
Latest<T> Context::create_latest(std::string_view topic) {
  return Latest<T>(detail::create_view(core_, topic, T::default_instance(), 1, std::nullopt));
}

template <Message T>
History<T> Context::create_history(std::string_view topic, const HistoryOptions& options) {
  return History<T>(
      detail::create_view(core_, topic, T::default_instance(), options.depth, options.span));
}

}  // namespace fastcycle

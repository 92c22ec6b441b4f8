#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "broker/topics.h"
#include "config/description.h"
#include "config/problem.h"
#include "executor/executor.h"
#include "executor/simulation.h"
#include "fastcycle/library.h"
#include "host/chains.h"
#include "host/component_core.h"
#include "host/modes.h"
#include "host/param_changes.h"
#include "record/flight_recorder.h"
#include "record/recorder.h"

namespace fastcycle::host {

class FlightGuest;
class Guest;
class RecorderGuest;
class Replay;
class WallPace;

/// Why a run ended.
enum class EndReason : std::uint8_t {
  kNone,
  kTimeOver,         ///< The time that was asked for is over.
  kSourcesFinished,  ///< Every source said that its input is over.
  kIdle,             ///< In simulated time nothing is left that could happen.
  kRequested,        ///< Somebody asked for the end (Ctrl-C).
  kFault,            ///< A component failed whose policy is to stop the application.
  kStuck,            ///< Simulated time does not advance: components answer each other without end.
  kReplayFailed,     ///< The recording that is replayed cannot be read on.
};

[[nodiscard]] const char* to_word(EndReason reason) noexcept;

/// How time passes.
struct ClockOptions {
  bool is_simulated = false;
  double rate = 1.0;     ///< Live only.
  unsigned workers = 0;  ///< Simulated only; 0: as many as the machine has CPUs.
};

/// Whether a run that ended so has failed.
[[nodiscard]] bool is_failure(EndReason reason) noexcept;

/// Where a component's code comes from.
class ComponentClasses {
 public:
  ComponentClasses() = default;
  ComponentClasses(const ComponentClasses&) = delete;
  ComponentClasses& operator=(const ComponentClasses&) = delete;
  virtual ~ComponentClasses() = default;

  /// The class that `component` names, or null after adding to `problems` why there is none.
  virtual const ComponentClass* find(const config::ComponentDescription& component,
                                     config::Problems& problems) = 0;
};

/// What to do with a constructor that throws.
enum class ConstructorFault : std::uint8_t {
  kFault,    ///< A fault of the component: the others run on, or not, as the policy says.
  kMistake,  ///< A mistake, for a check that starts nothing.
};

/// All components and topics of one process, from description to the end of the run.
///
///     Application application(description, {.is_simulated = true});
///     application.build(libraries, problems, ConstructorFault::kFault);
///     application.start();
///     application.run(std::nullopt);
///     application.stop();
///
/// @threads  Confined to the control thread; `request_end` is Safe.
class Application {
 public:
  Application(config::ApplicationDescription description, const ClockOptions& clock);
  Application(const Application&) = delete;
  Application& operator=(const Application&) = delete;
  ~Application();

  /// Records what is published, from `start` to `stop`. Before `build`, or within a constructor.
  void record(const config::RecordDescription& description);
  /// Who records; null if nobody does.
  [[nodiscard]] const record::Recorder* recorder() const;

  /// Lets `guest` look on. Before `build`, or within a constructor; it has to live longer than the
  /// run.
  void add(Guest& guest) { guests_.push_back(&guest); }
  /// What a log must say of this run.
  [[nodiscard]] record::Explanation explanation() const;

  /// Feeds what `replay` has, from `start` to `stop`; the clock shows its times. Before `build`; it
  /// has to live longer than this.
  void replay(Replay& replay) { replay_ = &replay; }
  [[nodiscard]] Replay* replay() { return replay_; }
  [[nodiscard]] const Replay* replay() const { return replay_; }

  /// Lets simulated time go at this pace. Before `start`; it has to live longer than this.
  void set_pace(WallPace& pace);
  /// Keeps the last messages in a file that outlives the process, from `start` to `stop`. Before
  /// `build`, which makes the file.
  void keep_last(const config::FlightRecorderDescription& description);
  /// Null if there is none.
  [[nodiscard]] const record::FlightRecorder* flight_recorder() const;
  /// Asks the flight recorder to write what it kept, and what comes in the seconds after this.
  /// False if there is none. Safe.
  bool dump(std::string_view reason, std::string_view component = {},
            std::string_view detail = {}) noexcept;

  /// Components may publish what is FastCycle's own otherwise: for tests. Before `build`.
  bool own_topics_are_free = false;

  /// Called with a component's name before its constructor.
  std::function<void(const std::string& component)> before_construct;

  /// Constructs all components, connects all topics, and finds what does not fit together.
  void build(ComponentClasses& classes, config::Problems& problems, ConstructorFault on_throw);

  /// Starts workers and components, in the order of the file but each after those that it names
  /// under `"after"`, then the timers. Returns what the machine refused.
  std::vector<base::Refusal> start();

  /// Lets the components work until `limit` of application time is over, or something else ends it.
  EndReason run(std::optional<Duration> limit);

  /// Simulated time only: serves everything up to `time`.
  void advance_to(Time time);
  /// Simulated time only: serves what is left to do at the present time.
  void settle();

  /// Sources and timers stop, what is under way is served for up to 1 s, then components stop in
  /// the reverse order of their starts; the rest is counted as dropped. Then destroys the
  /// components.
  void stop();

  /// Asks for the mode `mode`; see `Context::switch_mode`. Before the end of `start` it waits.
  /// Safe.
  ///
  /// @errors  std::invalid_argument if there is no such mode.
  void switch_mode(std::string_view mode, std::string_view why = {}) {
    modes_.ask(mode, why, nullptr);
  }
  [[nodiscard]] Modes& modes() { return modes_; }
  [[nodiscard]] const Modes& modes() const { return modes_; }

  [[nodiscard]] Chains& chains() { return chains_; }
  [[nodiscard]] const Chains& chains() const { return chains_; }

  /// Changes parameters of components, all that are named or none, and says what is wrong. Each
  /// component has the new values before it gets anything that is published after this returned.
  /// In simulated time they are in place from the next round on, in all components alike, also
  /// where another thread asks in the midst of a round. Safe; from `build` to the end of `stop`.
  ParamsResult change_params(const std::vector<ParamChange>& changes) {
    return params_.make(changes, {});
  }

  void request_end(EndReason reason);
  [[nodiscard]] EndReason end_reason() const { return end_reason_.load(); }

  // What components use, through their context.
  [[nodiscard]] const config::ApplicationDescription& description() const { return description_; }
  [[nodiscard]] const base::Clock& clock() const { return clock_; }
  [[nodiscard]] detail::Topics& topics() { return topics_; }
  [[nodiscard]] const detail::Topics& topics() const { return topics_; }
  /// Keeps the topics as they are while `look` reads their counters; any thread, at any time.
  template <typename Look>
  void look_at_topics(const Look& look) const {
    const std::lock_guard lock(topics_mutex_);
    look(topics_);
  }
  [[nodiscard]] detail::LogQueue& log_queue() { return log_queue_; }
  [[nodiscard]] Time start_time() const { return base::from_ns(start_ns_.load()); }
  [[nodiscard]] bool is_built() const { return is_built_; }
  void log(LogLevel level, std::string_view component, std::string_view text) {
    log_queue_.write(level, component, text);
  }
  [[nodiscard]] ParamChanges& params() { return params_; }
  [[nodiscard]] const ParamChanges& params() const { return params_; }
  /// For `component`, in an activation of it; `done` is another one.
  void change_params(detail::ComponentCore& component, std::vector<ParamChange> changes,
                     std::function<void(const ParamsResult&)> done);
  /// Does `action` now; in simulated time when no round is under way.
  void between_rounds(std::function<void()> action);
  /// Does `action` where nobody publishes with `publisher` meanwhile, now or soon: in an activation
  /// of its component, of an external one under its lock, in simulated time between two rounds.
  /// For who is no component. Safe, from the start to the end of `stop`, after which it may never
  /// be done.
  void beside(detail::PublisherCore& publisher, std::function<void()> action);
  void submit(const std::string& executor, detail::ComponentCore& from, std::function<void()> job);
  /// Subscriptions that come and go while publishers run; in an activation of `component`.
  detail::CallbackSubscription& subscribe_late(detail::ComponentCore& component,
                                               const std::string& topic,
                                               const google::protobuf::Message& default_instance,
                                               const SubscriberOptions& options,
                                               detail::EnvelopeCallback callback);
  void end_subscription(detail::ComponentCore& component,
                        detail::CallbackSubscription& subscription,
                        detail::DropReason reason = detail::DropReason::kUnsubscribed) noexcept;
  /// Tells the subscribers of all that `component` publishes that it has ended, or is back; in its
  /// activation.
  void tell_liveliness(detail::ComponentCore& component, bool is_alive, std::string_view reason);
  /// Connects again what had ended, for a component that is made anew.
  void reopen_subscription(detail::ComponentCore& component,
                           detail::CallbackSubscription& subscription);
  void source_finished(detail::ComponentCore& component);
  void component_failed(detail::ComponentCore& component);
  void fault_noted(const detail::ComponentCore& component, std::string_view what);
  /// `component` has another state, health, fault, or, not urgently, another reason for its health;
  /// in its activation.
  void component_changed(detail::ComponentCore& component, bool is_urgent = true);
  /// In simulated time between two rounds.
  void mode_changed();
  void hold_time();
  void let_time_go();
  /// Of a service that some component gives or calls; "?" if none does.
  [[nodiscard]] std::string service_name(std::uint64_t id) const;
  [[nodiscard]] detail::Simulation* simulation() { return simulation_.get(); }

  [[nodiscard]] const std::vector<std::unique_ptr<detail::ComponentCore>>& components() const {
    return components_;
  }
  [[nodiscard]] const std::vector<std::unique_ptr<detail::Executor>>& executors() const {
    return executors_;
  }
  /// In the order of `executors`; in simulated time, where there are none, the same names.
  [[nodiscard]] std::vector<std::string> executor_names() const;
  [[nodiscard]] const std::vector<base::Refusal>& refusals() const { return refusals_; }
  [[nodiscard]] Time end_time() const { return end_time_; }

 private:
  void make_executors();
  [[nodiscard]] bool needs_pool() const;
  detail::Executor& executor_of(const config::ComponentDescription& component);
  void add_component(const config::ComponentDescription& description,
                     const ComponentClass& its_class);
  void check_own_topics(config::Problems& problems) const;
  [[nodiscard]] bool is_status_wanted() const;
  void add_status(config::Problems& problems);
  void add_conflicts(config::Problems& problems) const;
  void add_quality_conflicts(config::Problems& problems) const;
  [[nodiscard]] config::Place place_of(const std::string& component) const;
  void run_in(detail::ComponentCore& component, detail::Cause cause, std::function<void()> body);
  void connect_late(detail::ComponentCore& component, detail::PublisherCore& publisher,
                    detail::CallbackSubscription& subscription);
  void run_at(detail::PublisherCore& publisher, detail::ComponentCore& from,
              std::function<void()> action);
  [[nodiscard]] detail::ComponentCore& component_of(const detail::PublisherCore& publisher) const;
  void start_component(detail::ComponentCore& component);
  void begin_part(std::uint32_t part);
  void begin_run();
  Time begin_of_timers();
  void watch_overflows();
  void start_guests();
  [[nodiscard]] bool is_real_time() const;
  [[nodiscard]] base::ThreadOptions options_of(const config::ComponentDescription& component,
                                               const std::string& thread) const;
  void start_threads();
  void stop_threads();
  void drain();
  [[nodiscard]] bool is_quiet() const;
  [[nodiscard]] bool sources_are_finished() const;
  EndReason run_simulated(std::optional<Duration> limit);

  const config::ApplicationDescription description_;
  base::Clock clock_;
  detail::LogQueue log_queue_;
  /// Control plane: when subscriptions come and go. Who looks on may hold it at a low priority.
  mutable detail::PriorityMutex topics_mutex_;
  detail::Topics topics_;
  ParamChanges params_{*this};
  std::map<std::uint64_t, std::string> service_names_;  ///< By id; constant once built.
  std::vector<std::unique_ptr<detail::ComponentCore>> components_;
  std::vector<std::size_t> start_order_;  ///< Places in `components_`.
  Modes modes_{*this};
  Chains chains_{*this};
  std::vector<std::unique_ptr<detail::Executor>> executors_;
  std::unique_ptr<detail::Simulation> simulation_;
  detail::ComponentCore* status_ = nullptr;  ///< Who publishes the status; null if nobody does.
  std::optional<config::RecordDescription> recorded_;
  std::unique_ptr<RecorderGuest> recorder_;
  Replay* replay_ = nullptr;
  WallPace* pace_ = nullptr;
  std::optional<config::FlightRecorderDescription> kept_;
  std::unique_ptr<FlightGuest> flight_recorder_;
  std::vector<Guest*> guests_;
  std::vector<Guest*> hearing_guests_;  ///< Of these, who wants changes of components.
  std::unique_ptr<detail::OverflowWatch> overflow_watch_;  ///< If a guest wants to know.
  std::vector<base::Refusal> refusals_;
  std::vector<base::Thread> threads_;
  std::atomic<int> running_threads_{0};
  std::stop_source thread_stop_;
  bool is_built_ = false;
  bool is_started_ = false;
  std::atomic<bool> is_stopped_{false};
  std::atomic<std::int64_t> start_ns_{0};
  Time end_time_{};

  std::mutex end_mutex_;
  std::condition_variable end_changed_;
  std::atomic<EndReason> end_reason_{EndReason::kNone};
};

}  // namespace fastcycle::host

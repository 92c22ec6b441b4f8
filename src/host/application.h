#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "broker/topics.h"
#include "component/application_host.h"
#include "component/bell.h"
#include "component/component_core.h"
#include "component/lifecycle.h"
#include "component/time_driver.h"
#include "component/wiring.h"
#include "config/description.h"
#include "config/problem.h"
#include "faults/injector.h"
#include "host/follower_news.h"
#include "host/life_changes.h"
#include "host/observers.h"
#include "host/param_changes.h"
#include "host/peer_dumps.h"
#include "host/peer_log.h"
#include "host/peer_news.h"
#include "host/pool_reporter.h"
#include "host/reloads.h"
#include "host/status_news.h"
#include "loading/component_classes.h"
#include "modes/chains.h"
#include "modes/modes.h"
#include "record/flight_recorder.h"
#include "record/recorder.h"

namespace fastcycle::host {

class FlightObserver;
class RecorderObserver;
class Replay;
class WallPace;

/// Why a run ended.
enum class EndReason : std::uint8_t {
  kNone,
  kTimeOver,         ///< The requested time has passed.
  kSourcesFinished,  ///< Every source has finished.
  kIdle,             ///< In simulated time no event is left.
  kRequested,        ///< The end was requested (Ctrl-C).
  kFault,            ///< A component failed whose policy is to stop the application.
  kStuck,            ///< Simulated time does not advance: components answer each other without end.
  kReplayFailed,     ///< The replayed recording cannot be read further.
};

[[nodiscard]] const char* to_word(EndReason reason) noexcept;
/// The reason with this name; `kFault` if there is none.
[[nodiscard]] EndReason end_reason_of(std::string_view word) noexcept;

/// Options of the clock.
struct ClockOptions {
  bool is_simulated = false;
  double rate = 1.0;  ///< Live only.
  /// Live only: the clock that it shares with the application's other processes; else its own.
  std::optional<base::Clock> shared = {};
  unsigned workers = 0;  ///< Simulated only; 0: as many as the machine has CPUs.
};

/// Whether a run that ended so has failed.
[[nodiscard]] bool is_failure(EndReason reason) noexcept;

/// All components and topics of one process, from description to the end of the run: owns the parts
/// and runs them.
///
///     Application application(description, {.is_simulated = true});
///     application.build(libraries, problems, ConstructorFault::kFault);
///     application.start();
///     application.run(std::nullopt);
///     application.stop();
///
/// @threads  Confined to the control thread; `request_end` is Safe.
class Application final : public ApplicationHost {
 public:
  Application(config::ApplicationDescription description, const ClockOptions& clock);
  /// With a driver of time for a replay: this is built, and never started.
  Application(std::unique_ptr<TimeDriver> driver, config::ApplicationDescription description);
  Application(const Application&) = delete;
  Application& operator=(const Application&) = delete;
  /// Waits, without a limit, for `stuck` components: memory that a thread may still use cannot be
  /// freed. A program that cannot wait ends by `std::_Exit` before this.
  ~Application();

  // Before `build`, or within a constructor.

  /// Records published messages, from `start` to `stop`.
  void record(const config::RecordDescription& description) override;
  /// The recorder; null if there is none.
  [[nodiscard]] const record::Recorder* recorder() const;
  [[nodiscard]] bool is_recorded() const override { return recorder_ != nullptr; }
  /// Adds `observer`, which outlives the run.
  void add(Observer& observer) { observers_.add(observer); }

  // Before `build`.

  /// Feeds the messages of `replay`, from `start` to `stop`; the clock has its times. It outlives
  /// this.
  void replay(Replay& replay) { replay_ = &replay; }
  [[nodiscard]] const Replay* replay() const { return replay_; }
  /// Keeps the last messages in a file that outlives the process, from `start` to `stop`; `build`
  /// creates the file.
  void keep_last(const config::FlightRecorderDescription& description);
  /// Null if there is none.
  [[nodiscard]] const record::FlightRecorder* flight_recorder() const;
  /// Requests the flight recorder to write the messages that it kept, and those of the next
  /// seconds. False if there is none. Safe.
  bool dump(std::string_view reason, std::string_view component = {},
            std::string_view detail = {}) noexcept override;
  /// Allows components to publish FastCycle's own topics: for tests.
  bool own_topics_are_free = false;
  /// Makes it one process of several; `peers` outlives this.
  void set_peers(Peers& peers) { peers_ = &peers; }
  /// In simulated time, before the start: sets the begin to `time`.
  void begin_at(Time time) { clock_.restart(time); }
  [[nodiscard]] Peers* peers() const override { return peers_; }
  /// Declares the publishers of a component that a replay replaces.
  std::function<void(detail::ComponentCore&)> declare_stand_in;
  /// Called with a component's name before its constructor.
  std::function<void(const std::string& component)> before_construct;

  /// Sets the pace of simulated time. Before `start`; it outlives this.
  void set_pace(WallPace& pace) { driver_->set_pace(pace); }

  /// Constructs all components, connects all topics, and adds conflicts to `problems`.
  void build(ComponentClasses& classes, config::Problems& problems, ConstructorFault on_throw);

  /// Constructs the components without checks of the whole: for a trial.
  void construct_only(ComponentClasses& classes, config::Problems& problems);

  /// Starts workers and components, in the order of the file but each after those that it names
  /// under `"after"`, then the timers. Returns what the machine refused.
  ///
  /// Live: a component that has not started after `within`, on the machine's clock, ends the run as
  /// a fault. `request_end` ends it at once. Neither waits for a component that does not return.
  std::vector<base::Refusal> start(std::optional<Duration> within = {});

  /// Runs the components until `limit` of application time has passed, or another reason ends the
  /// run.
  EndReason run(std::optional<Duration> limit);

  /// Simulated time only: serves everything up to `time`.
  void advance_to(Time time) { driver_->advance_to(time); }
  /// Simulated time only: serves what is left to do at the present time.
  void settle() { driver_->settle(); }

  /// Stops sources and timers, serves waiting messages for up to 1 s, then stops components in the
  /// reverse order of their starts; the rest is counted as dropped. Then destroys the components.
  ///
  /// Live, this takes no longer than `Lifecycle::kEndLimit` plus a second, regardless of the
  /// components. Those that have not returned by then are `stuck`: their objects are not destroyed.
  void stop();
  /// After `stop`: the calls that have not returned.
  [[nodiscard]] const std::vector<StuckCall>& stuck() const { return lifecycle_.stuck(); }

  /// Requests the mode `mode`; see `Context::switch_mode`. The request waits for the end of
  /// `start`. Safe.
  ///
  /// @errors  std::invalid_argument if there is no such mode.
  void switch_mode(std::string_view mode, std::string_view why = {}) {
    modes_.ask(mode, why, nullptr);
  }

  /// Changes parameters of components, all or none, and returns the errors. Each component has the
  /// new values before it receives a message that is published after this returned. In simulated
  /// time they apply from the next round on, in all components, also if another thread requests it
  /// during a round. Safe; from `build` to the end of `stop`.
  ParamsResult change_params(const std::vector<ParamChange>& changes) {
    return params_.make(changes, {});
  }

  /// Restarts, stops or starts a component, as `LifeChanges::make`. Safe.
  void change_life(detail::ComponentCore& component, detail::LifeStep step,
                   LifeChanges::Done done) {
    life_changes_.make(component, step, std::move(done));
  }

  /// Replaces the process of `component` by its standby. Returns why that cannot be done; empty if
  /// it can. Safe.
  [[nodiscard]] std::string switch_to_standby(const detail::ComponentCore& component) {
    return peers_ == nullptr ? "component \"" + component.name + "\" has no standby"
                             : peers_->switch_to_standby(component.name);
  }
  /// Replaces a component by one of another library, as `Reloads::reload`. Safe.
  void reload(detail::ComponentCore& component, const ReloadRequest& request,
              LifeChanges::Done done) {
    reloads_.reload(component, request, std::move(done));
  }
  /// As `Reloads::set_library_path`.
  void set_library_path(std::vector<std::filesystem::path> library_path) {
    reloads_.set_library_path(std::move(library_path));
  }

  void request_end(EndReason reason);
  [[nodiscard]] EndReason end_reason() const { return end_reason_.load(); }

  /// The description of this run for a log.
  [[nodiscard]] record::Explanation explanation() const;

  // For its parts and observers.
  [[nodiscard]] const config::ApplicationDescription& description() const override {
    return description_;
  }
  [[nodiscard]] const base::Clock& clock() const override { return clock_; }
  [[nodiscard]] TimeDriver& time() override { return *driver_; }
  [[nodiscard]] const TimeDriver& time() const { return *driver_; }
  [[nodiscard]] Wiring& wiring() override { return wiring_; }
  [[nodiscard]] const Wiring& wiring() const { return wiring_; }
  [[nodiscard]] Lifecycle& threads() override { return lifecycle_; }
  [[nodiscard]] const Modes& modes() const { return modes_; }
  [[nodiscard]] const Chains& chains() const { return chains_; }
  /// All chains; in the main process with those that end in another process. Safe.
  [[nodiscard]] std::vector<ChainReport> chains_of_all_processes() const {
    return peer_news_.chains();
  }
  /// In the main process, after the stop; see `PeerNews`.
  [[nodiscard]] std::vector<EarlierRuns> earlier_runs() const { return peer_news_.earlier_runs(); }
  [[nodiscard]] const ParamChanges& params() const { return params_; }
  [[nodiscard]] ParamMutex& param_mutex() override { return params_.mutex(); }
  [[nodiscard]] detail::LogQueue& log_queue() override { return log_queue_; }
  [[nodiscard]] detail::LogSource& own_log() override { return own_log_; }
  [[nodiscard]] detail::Topics& topics() { return wiring_.topics(); }
  [[nodiscard]] const detail::Topics& topics() const { return wiring_.topics(); }
  /// As `Wiring::look`.
  template <typename Look>
  void look_at_topics(const Look& look) const {
    wiring_.look(look);
  }
  /// As `Wiring::beside`.
  void beside(detail::PublisherCore& publisher, std::function<void()> action) {
    wiring_.beside(publisher, std::move(action));
  }
  /// As `TimeDriver::between_rounds`.
  void between_rounds(std::function<void()> action) { driver_->between_rounds(std::move(action)); }
  [[nodiscard]] Time start_time() const override { return base::from_ns(start_ns_.load()); }
  [[nodiscard]] Time end_time() const { return end_time_; }
  [[nodiscard]] bool is_built() const override { return is_built_; }
  [[nodiscard]] const Components& components() const override { return components_; }
  [[nodiscard]] bool is_replay() const override { return replay_ != nullptr; }
  [[nodiscard]] bool is_replayed(const std::string& component) const override;
  [[nodiscard]] bool runs_elsewhere(const std::string& component) const override;
  [[nodiscard]] std::string service_name(std::uint64_t id) const override;
  /// The injector of faults; null if there is none.
  [[nodiscard]] const faults::Injector* injector() const { return injector_.get(); }
  /// None in simulated time.
  [[nodiscard]] const std::vector<std::unique_ptr<detail::Executor>>& executors() const {
    return driver_->executors();
  }
  /// In the order of `executors`; in simulated time, where there are none, the same names.
  [[nodiscard]] std::vector<std::string> executor_names() const {
    return host::executor_names(description_);
  }
  [[nodiscard]] const std::vector<base::Refusal>& refusals() const { return refusals_; }

  /// In the main process: the reports of standby processes.
  [[nodiscard]] const FollowerNews& follower_news() const { return follower_news_; }

  // Notifications from components.
  void end_by_fault() override { request_end(EndReason::kFault); }
  [[nodiscard]] bool may_end_process(const detail::ComponentCore& component) const override;
  void end_process(detail::ComponentCore& component, const std::string& what) override;
  [[nodiscard]] bool is_to_end() const override;
  void component_changed(detail::ComponentCore& component, bool is_urgent) override;
  /// A call of `component` exceeds its limit, or, if `hang` is empty, has returned. Safe.
  void hang_changed(detail::ComponentCore& component, std::string hang);
  void fault_noted(const detail::ComponentCore& component, std::string_view what) override;
  void component_failed(detail::ComponentCore& component) override;
  void source_finished(detail::ComponentCore& component) override;
  void mode_changed() override { status_.mode_changed(); }
  void chain_breached(detail::ComponentCore& sink, std::size_t chain) override;
  void deadline_missed(const QosEvent& event) override { reloads_.deadline_missed(event); }
  void version_changed(detail::ComponentCore& component) override;
  [[nodiscard]] std::string mode() const override { return modes_.current(); }
  void ask_mode(std::string_view mode, std::string_view why, detail::ComponentCore& by) override {
    if (!by.publishing.is_following) {
      modes_.ask(mode, why, &by);
    }
  }
  void declare_replayed(detail::ComponentCore& component) override;
  void put_recorded_params(detail::ComponentCore& component, std::uint64_t transaction,
                           const std::string& text, config::Problems& problems) override {
    params_.take_recorded(component, transaction, text, problems);
  }
  void commit_recorded_params(detail::ComponentCore& component, const std::string& text,
                              config::Problems& problems) override {
    params_.commit_recorded(component, text, problems);
  }
  void change_params(detail::ComponentCore& component, std::vector<ParamChange> changes,
                     std::function<void(const ParamsResult&)> done) override {
    params_.make_later(component, std::move(changes), std::move(done));
  }
  [[nodiscard]] std::vector<ParamInfo> list_params() const override { return params_.list(); }

 private:
  void set_up();
  void listen_to_peers();
  /// Logs invalid messages of processes that are not trusted.
  void log_invalid_messages();
  void strike(const config::FaultDescription& fault, bool is_over);
  void add_component(const config::ComponentDescription& description,
                     const ComponentClass& its_class);
  void construct(config::Problems& problems, ConstructorFault on_throw,
                 std::set<std::string>& declared_params);
  void check(config::Problems& problems, const std::set<std::string>& declared_params);
  [[nodiscard]] bool is_own_topic_wanted(const std::string& name) const;
  void add_stand_in_for_own(const std::string& topic, config::ComponentDescription description,
                            config::Problems& problems);
  void add_status(config::Problems& problems);
  void add_log(config::Problems& problems);
  /// Whether all processes of the application serve the same rounds of simulated time.
  [[nodiscard]] bool shares_rounds() const;
  void begin_clock_of_replay();
  Time begin_of_timers();
  std::vector<const detail::ReadRing*> keep_reads();
  [[nodiscard]] bool sources_are_finished() const;
  [[nodiscard]] std::map<std::string, std::string> end_facts() const;
  /// Adds the components whose library differs from the file after a reload.
  void note_reloads(std::map<std::string, std::string>& facts) const;
  void destroy_components(const std::function<bool(const detail::ComponentCore&)>& is_left_alone);

  const config::ApplicationDescription description_;
  base::Clock clock_;
  detail::LogQueue log_queue_{clock_};
  detail::LogSource own_log_{log_queue_, detail::LogQueue::kOwnName, clock_,
                             description_.log_level};
  Bell bell_;
  std::unique_ptr<TimeDriver> driver_;
  Wiring wiring_{components_, *driver_};
  ParamChanges params_{*this};
  std::map<std::uint64_t, std::string> service_names_;  ///< By id; constant once built.
  Components components_;
  Modes modes_{*this};
  Chains chains_{*this, wiring_, modes_};
  StatusSender status_{*driver_};
  PeerNews peer_news_{*this, wiring_, chains_};
  PeerLog peer_log_{*this};
  PeerDumps peer_dumps_{*this};
  LifeChanges life_changes_{*this};
  FollowerNews follower_news_;
  Reloads reloads_{*this, wiring_, chains_, life_changes_};
  Lifecycle lifecycle_{*this, wiring_, *driver_, bell_};
  std::optional<config::RecordDescription> recorded_;
  std::optional<config::FlightRecorderDescription> kept_;
  PoolReporter pool_reporter_{own_log_};
  bool has_reported_snapshot_ = false;  ///< That it has no room. Of the thread of the notices.
  Observers observers_;
  RecorderObserver* recorder_ = nullptr;        ///< One of the observers, as the next one.
  FlightObserver* flight_recorder_ = nullptr;   ///< Null if there is none.
  std::unique_ptr<faults::Injector> injector_;  ///< Null if no faults are configured.
  Replay* replay_ = nullptr;
  Peers* peers_ = nullptr;
  std::vector<base::Refusal> refusals_;
  bool is_built_ = false;
  std::atomic<bool> is_started_ = false;  ///< The observers have begun.
  bool is_stopped_ = false;
  std::atomic<std::int64_t> start_ns_{0};
  Time end_time_{};
  std::atomic<EndReason> end_reason_{EndReason::kNone};
};

}  // namespace fastcycle::host

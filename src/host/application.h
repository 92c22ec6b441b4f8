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
#include "host/peer_log.h"
#include "host/peer_news.h"
#include "host/pool_teller.h"
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
  kTimeOver,         ///< The time that was asked for is over.
  kSourcesFinished,  ///< Every source said that its input is over.
  kIdle,             ///< In simulated time nothing is left that could happen.
  kRequested,        ///< Somebody asked for the end (Ctrl-C).
  kFault,            ///< A component failed whose policy is to stop the application.
  kStuck,            ///< Simulated time does not advance: components answer each other without end.
  kReplayFailed,     ///< The recording that is replayed cannot be read on.
};

[[nodiscard]] const char* to_word(EndReason reason) noexcept;
/// The reason of which this is the word; `kFault` if it is none.
[[nodiscard]] EndReason end_reason_of(std::string_view word) noexcept;

/// How time passes.
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
/// and leads them through it.
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
  /// With a driver of time that executes a recorded run again: this is built, and never started.
  Application(std::unique_ptr<TimeDriver> driver, config::ApplicationDescription description);
  Application(const Application&) = delete;
  Application& operator=(const Application&) = delete;
  /// Waits, without a limit, for who is `stuck`: what a thread may still use cannot be taken away.
  /// A program that cannot wait leaves by `std::_Exit` before this.
  ~Application();

  // Before `build`, or within a constructor.

  /// Records what is published, from `start` to `stop`.
  void record(const config::RecordDescription& description) override;
  /// Who records; null if nobody does.
  [[nodiscard]] const record::Recorder* recorder() const;
  [[nodiscard]] bool is_recorded() const override { return recorder_ != nullptr; }
  /// Lets `observer` look on; it has to live longer than the run.
  void add(Observer& observer) { observers_.add(observer); }

  // Before `build`.

  /// Feeds what `replay` has, from `start` to `stop`; the clock shows its times. It has to live
  /// longer than this.
  void replay(Replay& replay) { replay_ = &replay; }
  [[nodiscard]] const Replay* replay() const { return replay_; }
  /// Keeps the last messages in a file that outlives the process, from `start` to `stop`; `build`
  /// makes the file.
  void keep_last(const config::FlightRecorderDescription& description);
  /// Null if there is none.
  [[nodiscard]] const record::FlightRecorder* flight_recorder() const;
  /// Asks the flight recorder to write what it kept, and what comes in the seconds after this.
  /// False if there is none. Safe.
  bool dump(std::string_view reason, std::string_view component = {},
            std::string_view detail = {}) noexcept override;
  /// Components may publish what is FastCycle's own otherwise: for tests.
  bool own_topics_are_free = false;
  /// It is one process of several; these have to live longer than this.
  void set_peers(Peers& peers) { peers_ = &peers; }
  /// In simulated time, before the start: it begins at `time`.
  void begin_at(Time time) { clock_.restart(time); }
  [[nodiscard]] Peers* peers() const override { return peers_; }
  /// Declares the publishers of a component in whose place a recording is executed again.
  std::function<void(detail::ComponentCore&)> declare_stand_in;
  /// Called with a component's name before its constructor.
  std::function<void(const std::string& component)> before_construct;

  /// Lets simulated time go at this pace. Before `start`; it has to live longer than this.
  void set_pace(WallPace& pace) { driver_->set_pace(pace); }

  /// Constructs all components, connects all topics, and finds what does not fit together.
  void build(ComponentClasses& classes, config::Problems& problems, ConstructorFault on_throw);

  /// Constructs the components, and looks at nothing that concerns them as a whole: for a trial.
  void construct_only(ComponentClasses& classes, config::Problems& problems);

  /// Starts workers and components, in the order of the file but each after those that it names
  /// under `"after"`, then the timers. Returns what the machine refused.
  ///
  /// Live: what has not started after `within`, on the machine's clock, ends the run as a fault. So
  /// does `request_end`, at once: neither waits for a component that does not come back.
  std::vector<base::Refusal> start(std::optional<Duration> within = {});

  /// Lets the components work until `limit` of application time is over, or something else ends it.
  EndReason run(std::optional<Duration> limit);

  /// Simulated time only: serves everything up to `time`.
  void advance_to(Time time) { driver_->advance_to(time); }
  /// Simulated time only: serves what is left to do at the present time.
  void settle() { driver_->settle(); }

  /// Sources and timers stop, what is under way is served for up to 1 s, then components stop in
  /// the reverse order of their starts; the rest is counted as dropped. Then destroys the
  /// components.
  ///
  /// Live, all this takes no longer than `Lifecycle::kEndLimit`, and a second, whatever components
  /// do. Those that have not come back by then are `stuck`: their objects are left alone.
  void stop();
  /// After `stop`: the calls that have not returned.
  [[nodiscard]] const std::vector<StuckCall>& stuck() const { return lifecycle_.stuck(); }

  /// Asks for the mode `mode`; see `Context::switch_mode`. Before the end of `start` it waits.
  /// Safe.
  ///
  /// @errors  std::invalid_argument if there is no such mode.
  void switch_mode(std::string_view mode, std::string_view why = {}) {
    modes_.ask(mode, why, nullptr);
  }

  /// Changes parameters of components, all that are named or none, and says what is wrong. Each
  /// component has the new values before it gets anything that is published after this returned.
  /// In simulated time they are in place from the next round on, in all components alike, also
  /// where another thread asks in the midst of a round. Safe; from `build` to the end of `stop`.
  ParamsResult change_params(const std::vector<ParamChange>& changes) {
    return params_.make(changes, {});
  }

  /// Restarts, stops or starts a component, as `LifeChanges::make`. Safe.
  void change_life(detail::ComponentCore& component, detail::LifeStep step,
                   LifeChanges::Done done) {
    life_changes_.make(component, step, std::move(done));
  }

  /// Has the process of `component` give its place to its standby. Returns why not; empty if it
  /// does. Safe.
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

  /// What a log must say of this run.
  [[nodiscard]] record::Explanation explanation() const;

  // What its parts and those who look on use.
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
  /// Who injects faults; null if nobody does.
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

  /// In the main process: what processes that follow others say of themselves.
  [[nodiscard]] const FollowerNews& follower_news() const { return follower_news_; }

  // What components tell.
  void end_by_fault() override { request_end(EndReason::kFault); }
  [[nodiscard]] bool may_end_process(const detail::ComponentCore& component) const override;
  void end_process(detail::ComponentCore& component, const std::string& what) override;
  [[nodiscard]] bool is_to_end() const override;
  void component_changed(detail::ComponentCore& component, bool is_urgent) override;
  /// A call of `component` takes longer than it may, or, if `hang` is empty, does no more. Safe.
  void hang_changed(detail::ComponentCore& component, std::string hang);
  void fault_noted(const detail::ComponentCore& component, std::string_view what) override;
  void component_failed(detail::ComponentCore& component) override;
  void source_finished(detail::ComponentCore& component) override;
  void mode_changed() override { status_.mode_changed(); }
  void chain_breached(detail::ComponentCore& sink, std::size_t chain) override {
    chains_.breached(sink, chain);
    reloads_.chain_breached(chain);
  }
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
  /// Which components a reload has made of another library than the file says.
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
  StatusTeller status_{*driver_};
  PeerNews peer_news_{*this, wiring_};
  PeerLog peer_log_{*this};
  LifeChanges life_changes_{*this};
  FollowerNews follower_news_;
  Reloads reloads_{*this, wiring_, chains_, life_changes_};
  Lifecycle lifecycle_{*this, wiring_, *driver_, bell_};
  std::optional<config::RecordDescription> recorded_;
  std::optional<config::FlightRecorderDescription> kept_;
  PoolTeller pool_teller_{own_log_};
  Observers observers_;
  RecorderObserver* recorder_ = nullptr;        ///< One of the observers, as the next one.
  FlightObserver* flight_recorder_ = nullptr;   ///< Null if there is none.
  std::unique_ptr<faults::Injector> injector_;  ///< Null where no faults are asked for.
  Replay* replay_ = nullptr;
  Peers* peers_ = nullptr;
  std::vector<base::Refusal> refusals_;
  bool is_built_ = false;
  bool is_started_ = false;
  bool is_stopped_ = false;
  std::atomic<std::int64_t> start_ns_{0};
  Time end_time_{};
  std::atomic<EndReason> end_reason_{EndReason::kNone};
};

}  // namespace fastcycle::host

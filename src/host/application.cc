#include "host/application.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <stdexcept>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/memory.h"
#include "calls/services.h"
#include "component/credits.h"
#include "component/own_names.h"
#include "component/peers.h"
#include "component/reloading.h"
#include "config/params.h"
#include "diagnostics/crash_reporter.h"
#include "host/build_checks.h"
#include "host/explanation.h"
#include "host/live_driver.h"
#include "host/log_topic.h"
#include "host/recording.h"
#include "host/simulated_driver.h"
#include "host/status.h"
#include "replay/replay.h"
#include "replay/stand_in.h"

namespace fastcycle::host {

using detail::ComponentCore;

namespace {

base::Clock make_clock(const ClockOptions& options) {
  if (options.shared) {
    return *options.shared;
  }
  return options.is_simulated ? base::Clock::simulated() : base::Clock::live(options.rate);
}

std::unique_ptr<TimeDriver> make_driver(const ClockOptions& options, base::Clock& clock,
                                        const config::ApplicationDescription& description,
                                        Bell& bell) {
  if (options.is_simulated) {
    return std::make_unique<SimulatedDriver>(clock, options.workers);
  }
  return std::make_unique<LiveDriver>(clock, description, bell);
}

}  // namespace

const char* to_word(EndReason reason) noexcept {
  switch (reason) {
    case EndReason::kNone:
      return "running";
    case EndReason::kTimeOver:
      return "time over";
    case EndReason::kSourcesFinished:
      return "input finished";
    case EndReason::kIdle:
      return "nothing left to do";
    case EndReason::kRequested:
      return "stopped on request";
    case EndReason::kFault:
      return "component fault";
    case EndReason::kStuck:
      return "simulated time does not advance";
    case EndReason::kReplayFailed:
      return "recording cannot be read";
  }
  return "?";
}

bool is_failure(EndReason reason) noexcept {
  return reason == EndReason::kFault || reason == EndReason::kStuck ||
         reason == EndReason::kReplayFailed;
}

Application::Application(config::ApplicationDescription description, const ClockOptions& options)
    : description_(std::move(description)),
      clock_(make_clock(options)),
      driver_(make_driver(options, clock_, description_, bell_)) {
  set_up();
}

Application::Application(std::unique_ptr<TimeDriver> driver,
                         config::ApplicationDescription description)
    : description_(std::move(description)),
      clock_(base::Clock::simulated()),
      driver_(std::move(driver)) {
  set_up();
}

/// Sets the topics' options from the file.
void Application::set_up() {
  topics().set_default_options(kStatusTopic, {.latched = 1, .ages = false});
  topics().set_default_options(kLogTopic, {.ages = false});
  for (const config::TopicDescription& topic : description_.topics) {
    topics().set_options(topic.name, {.latched = static_cast<std::size_t>(topic.latched),
                                      .ages = topic.ages,
                                      .keep = topic.keep,
                                      .pool_max = topic.pool_max.value_or(0),
                                      .multiple_publishers = topic.multiple_publishers,
                                      .external = topic.external,
                                      .lifespan = topic.lifespan,
                                      .credits = topic.credits});
  }
  chains_.declare(topics());
}

EndReason end_reason_of(std::string_view word) noexcept {
  for (int reason = 0; reason <= static_cast<int>(EndReason::kReplayFailed); ++reason) {
    if (word == to_word(static_cast<EndReason>(reason))) {
      return static_cast<EndReason>(reason);
    }
  }
  return EndReason::kFault;
}

Application::~Application() {
  stop();
  driver_->join();
  lifecycle_.join_threads();
  destroy_components([](const ComponentCore&) { return false; });
}

// ---- Build ----

void Application::add_component(const config::ComponentDescription& component,
                                const ComponentClass& its_class) {
  auto core = std::make_unique<ComponentCore>(*this, static_cast<std::uint32_t>(components_.size()),
                                              component, its_class, driver_->clock_of_next(clock_));
  core->versions = std::make_unique<detail::Reloading>(*core);
  core->is_wanted = modes_.is_active_at_first(core->index);
  core->set_root_count(chains_.root_count());
  if (peers_ != nullptr) {
    core->inbox.lane_room = peers_->lane_room(component.name);
  }
  driver_->add(*core, component);
  components_.push_back(std::move(core));
}

void Application::log_invalid_messages() {
  for (const Peers::Invalid& one : peers_->take_invalid()) {
    log(LogLevel::kWarning, {},
        fmt::format("{} {} of \"{}\" from \"{}\" in the process \"{}\", which is not trusted, "
                    "{} not of the topic's type: dropped",
                    one.count, one.count == 1 ? "message" : "messages", one.topic, one.component,
                    one.process, one.count == 1 ? "was" : "were"));
  }
}

/// Lets what concerns all processes be taken here.
void Application::listen_to_peers() {
  peers_->on_notice = [this](const Notice& notice) {
    if (notice.kind == Notice::Kind::kReads) {
      peers_->give_latched(notice.process);
    }
    modes_.take(notice);
    params_.take(notice);
    peer_news_.take(notice);
    peer_log_.take(notice);
    peer_dumps_.take(notice);
    life_changes_.take(notice);
    follower_news_.take(notice);
  };
  peers_->on_round_ends = [this] { peer_log_.send_round(); };
  peers_->on_look = [this] {
    log_invalid_messages();
    return peer_news_.look();
  };
  peer_news_.on_news = [this](const ComponentNews& news) {
    if (end_reason() == EndReason::kNone) {  // Processes that end with the run have not failed.
      observers_.changed_elsewhere(news);
      status_.changed_elsewhere(news);
    }
  };
  peer_news_.on_fault = [this](const ComponentCore& component, const std::string& what) {
    if (is_started_ && end_reason() == EndReason::kNone) {
      observers_.faulted(component.name, what);
    }
  };
  peer_news_.on_lost = [this](const ComponentCore& component, const std::string& why) {
    if (!component.description.fault_mode.empty() && end_reason() == EndReason::kNone) {
      modes_.ask(component.description.fault_mode, component.name + ": " + why, nullptr);
    }
  };
  peers_->on_round_over = [this](bool is_anyone_busy) { modes_.round_is_over(is_anyone_busy); };
  peers_->is_busy = [this] { return modes_.is_busy(); };
  peers_->on_quiet = [this] {
    params_.all_have_answered();
    peer_news_.round_is_over();
    log_invalid_messages();
  };
  peers_->make_snapshot = [this] {
    return nlohmann::json{{"modes", modes_.make_snapshot()}, {"params", params_.make_snapshot()}}
        .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  };
  peers_->take_snapshot = [this](const std::string& text) {
    const auto json = nlohmann::json::parse(text);
    modes_.take_snapshot(json.at("modes").get<std::string>());
    params_.take_snapshot(json.at("params").get<std::string>());
  };
  peers_->on_snapshot_refused = [this](std::size_t bytes, std::size_t room) {
    if (peers_->is_main() && !std::exchange(has_reported_snapshot_, true)) {
      own_log_.write(
          LogLevel::kError,
          fmt::format("the params changed in this run take {} bytes, and there is room for {}: a "
                      "process that is restarted from now on may not get the last changes",
                      bytes, room));
    }
  };
}

void Application::build(ComponentClasses& classes, config::Problems& problems,
                        ConstructorFault on_throw) {
  if (peers_ != nullptr) {
    listen_to_peers();
  }
  modes_.resolve(problems);
  for (const config::ComponentDescription& component : description_.components) {
    if (const ComponentClass* its_class = classes.find(component, problems)) {
      add_component(component, *its_class);
    }
  }
  std::set<std::string> declared_params;
  construct(problems, on_throw, declared_params);
  if (components_.size() == description_.components.size()) {
    check(problems, declared_params);
  }
  if (problems.has_errors()) {
    return;
  }
  observers_.tap(topics());
  topics().set_pool_watch(pool_reporter_);
  // Where a recorded run is executed again, the log has what was received.
  if (!description_.faults.list.empty() && !driver_->is_recorded()) {
    injector_ = std::make_unique<faults::Injector>(description_.faults, clock_);
    injector_->strike = [this](const config::FaultDescription& fault, bool is_over) {
      strike(fault, is_over);
    };
    injector_->attach(topics(), peers_ == nullptr, problems);
  }
  topics().connect_all();
  observers_.open(problems);
  for (const auto& component : components_) {
    if (component->state == ComponentCore::State::kFailed) {
      component->close(detail::DropReason::kFault);
    }
  }
  is_built_ = !problems.has_errors();
}

void Application::construct_only(ComponentClasses& classes, config::Problems& problems) {
  for (const config::ComponentDescription& component : description_.components) {
    if (const ComponentClass* its_class = classes.find(component, problems)) {
      add_component(component, *its_class);
    }
  }
  std::set<std::string> ignored;
  construct(problems, ConstructorFault::kError, ignored);
}

void Application::construct(config::Problems& problems, ConstructorFault on_throw,
                            std::set<std::string>& declared_params) {
  for (const auto& component : components_) {
    if (before_construct) {
      before_construct(component->name);
    }
    const auto thrown = component->construct(problems);
    declared_params.merge(component->declared_params);
    if (!thrown) {
      continue;
    }
    const std::string what = "its constructor threw: " + *thrown;
    if (on_throw == ConstructorFault::kError) {
      problems.add(config::make_error(component->description.place,
                                      "component \"" + component->name + "\": " + what));
    } else if (!problems.has_errors()) {
      component->fail(what);
    }
  }
}

/// Checks the constructed components as a whole, and adds the parts that depend on it.
void Application::check(config::Problems& problems, const std::set<std::string>& declared_params) {
  lifecycle_.set_order(config::start_order(description_));
  if (!own_topics_are_free) {
    check_own_topics(components_, problems);
  }
  if (peers_ == nullptr || peers_->is_main()) {
    add_status(problems);
    add_log(problems);
  } else {
    add_stand_in_for_own(kStatusTopic, describe_status(description_), problems);
    add_stand_in_for_own(kLogTopic, describe_log(description_), problems);
  }
  const std::set<std::string>* services = nullptr;
  if (replay_ != nullptr) {
    services = &replay_->plan().services;
  } else if (peers_ != nullptr) {
    services = &peers_->services();
  } else {  // Else their users may not run here.
    config::check_shared(description_.shared_params, declared_params, problems);
  }
  service_names_ = connect_services(components_, topics(), services, problems);
  if (peers_ == nullptr) {  // Else the trial has checked the whole, of which this is a part.
    check_topics(description_, topics(), problems);
    check_quality(description_, components_, problems);
    check_credits(components_, topics(), problems);
    chains_.check(problems);
  }
  if (const auto& record = recorded_ ? recorded_ : description_.record) {
    check_patterns(*record, topics(), problems);
  }
  if (const auto& kept = kept_ ? kept_ : description_.flight_recorder) {
    check_patterns(*kept, topics(), problems);
  }
}

bool Application::is_own_topic_wanted(const std::string& name) const {
  const detail::Topic* topic = topics().find(name);
  if (topic != nullptr && !topic->publishers.empty()) {
    return false;  // A recording, or a test, publishes it.
  }
  const auto names_it = [&](const std::vector<std::string>& patterns) {
    return std::ranges::any_of(patterns, [&](const std::string& pattern) {
      return pattern == name || pattern == "/" + name;
    });
  };
  const auto& record = recorded_ ? recorded_ : description_.record;
  const auto& kept = kept_ ? kept_ : description_.flight_recorder;
  return (topic != nullptr && !topic->subscriptions.empty()) ||
         (peers_ != nullptr && peers_->is_wanted(name)) || (record && names_it(record->topics)) ||
         (kept && names_it(kept->topics));
}

/// For topics of the main process with subscribers here.
void Application::add_stand_in_for_own(const std::string& topic,
                                       config::ComponentDescription description,
                                       config::Problems& problems) {
  const detail::Topic* const its = topics().find(topic);
  const bool is_subscribed = its != nullptr && !its->subscriptions.empty();
  const bool is_published = its != nullptr && !its->publishers.empty();
  if (is_published || !(is_subscribed || (is_recorded() && peers_->is_wanted(topic)))) {
    return;
  }
  description.executor = description_.executors.back().name;  // Nothing is executed.
  add_component(description, stand_in_class());
  lifecycle_.add_last(components_.back()->index);
  static_cast<void>(components_.back()->construct(problems));
}

/// Behind the others, so that their numbers do not depend on observers.
void Application::add_status(config::Problems& problems) {
  if (!is_own_topic_wanted(kStatusTopic)) {
    return;
  }
  add_component(describe_status(description_), status_class());
  ComponentCore& core = *components_.back();
  status_.set_status(core, components_.size());
  lifecycle_.add_last(core.index);
  static_cast<void>(core.construct(problems));
  if (core.component != nullptr) {
    static_cast<StatusComponent*>(core.component)
        ->set_sources({.application = *this,
                       .modes = modes_,
                       .chains = chains_,
                       .wiring = wiring_,
                       .recorder = recorder()});
  }
}

/// Behind the status, which does not report it.
void Application::add_log(config::Problems& problems) {
  if (!is_own_topic_wanted(kLogTopic)) {
    return;
  }
  add_component(describe_log(description_), log_class());
  ComponentCore& core = *components_.back();
  lifecycle_.add_last(core.index);
  static_cast<void>(core.construct(problems));
  observers_.add(std::make_unique<LogFeed>(*this, core));
}

void Application::record(const config::RecordDescription& description) {
  recorded_ = description;
  auto recorder =
      std::make_unique<RecorderObserver>(description, clock_, own_log_,
                                         RunFacts{.at_start = [this] { return explanation(); },
                                                  .at_end = [this] { return end_facts(); }});
  recorder_ = recorder.get();
  observers_.add(std::move(recorder));
}

const record::Recorder* Application::recorder() const {
  return recorder_ == nullptr ? nullptr : &recorder_->recorder();
}

void Application::keep_last(const config::FlightRecorderDescription& description) {
  kept_ = description;
  auto recorder =
      std::make_unique<FlightObserver>(description, description_.name, clock_, own_log_, [this] {
        record::Explanation explanation = explain(description_, clock_, components_);
        note_reloads(explanation.facts);
        return explanation;
      });
  flight_recorder_ = recorder.get();
  observers_.add(std::move(recorder));
}

const record::FlightRecorder* Application::flight_recorder() const {
  return flight_recorder_ == nullptr ? nullptr : &flight_recorder_->recorder();
}

bool Application::dump(std::string_view reason, std::string_view component,
                       std::string_view detail) noexcept {
  if (flight_recorder_ == nullptr) {
    return peers_ != nullptr && !peers_->is_main() && peer_dumps_.ask(reason, component, detail);
  }
  flight_recorder_->dump(reason, component, detail);
  return true;
}

record::Explanation Application::explanation() const {
  record::Explanation explanation = explain(description_, clock_, components_);
  if (replay_ != nullptr) {
    replay_->explain(explanation.facts);
  }
  note_reloads(explanation.facts);
  return explanation;
}

void Application::note_reloads(std::map<std::string, std::string>& facts) const {
  for (const auto& component : components_) {
    const detail::VersionNews version = runs_elsewhere(component->name)
                                            ? peer_news_.version_of(component->index)
                                            : component->versions->news();
    if (version.reloads > 0) {
      facts["reloaded." + component->name] = version.library + " " + version.build_id;
    }
  }
}

/// The facts of this run for a recording at its end.
std::map<std::string, std::string> Application::end_facts() const {
  std::map<std::string, std::string> facts = {{"time_ns", std::to_string(base::to_ns(end_time_))},
                                              {"timers_ns", std::to_string(start_ns_.load())},
                                              {"reason", to_word(end_reason())}};
  explain(modes_.switches(), facts);
  note_reloads(facts);
  facts.merge(params_.facts());
  return facts;
}

bool Application::is_replayed(const std::string& component) const {
  return (replay_ != nullptr && !replay_->plan().runs(component)) || runs_elsewhere(component);
}

bool Application::runs_elsewhere(const std::string& component) const {
  return peers_ != nullptr && !peers_->runs_here(component);
}

void Application::declare_replayed(ComponentCore& component) {
  if (replay_ != nullptr && !replay_->plan().runs(component.name)) {
    replay_->declare(component);  // In all processes alike.
  } else if (peers_ != nullptr) {
    peers_->declare(component);
  } else {
    declare_stand_in(component);
  }
}

bool Application::shares_rounds() const {
  return peers_ != nullptr && peers_->rounds() != nullptr;
}

bool Application::is_to_end() const {
  if (shares_rounds()) {
    return peers_->agreed_end() == Peers::AgreedEnd::kOther;
  }
  return is_failure(end_reason()) || end_reason() == EndReason::kRequested;
}

std::string Application::service_name(std::uint64_t id) const {
  const auto found = service_names_.find(id);
  return found == service_names_.end() ? "?" : found->second;
}

// ---- Start, run, stop ----

/// When the timers start: now, or when they did in the run that is replayed.
Time Application::begin_of_timers() {
  if (replay_ == nullptr) {
    return peers_ != nullptr ? peers_->agree_on_begin(clock_, [this] { return is_to_end(); })
                             : clock_.now();
  }
  if (peers_ != nullptr && !driver_->is_simulated()) {
    static_cast<void>(peers_->agree_on_begin(clock_, [this] { return is_to_end(); }));
  }
  const Time begin = replay_->begin_of_timers();
  if (begin > clock_.now()) {
    advance_to(begin);  // Input received while the components started, which took time in the
                        // recorded run.
  }
  return begin;
}

/// The reads of activations, by component, if an observer wants them.
std::vector<const detail::ReadRing*> Application::keep_reads() {
  std::vector<const detail::ReadRing*> rings;
  const bool is_for_peers = peers_ != nullptr && peers_->keeps_activity();
  if (!observers_.want_reads() && !is_for_peers) {
    return rings;
  }
  const auto has_credits = [](const detail::PublisherCore* publisher) {
    return publisher->credits() != nullptr;
  };
  for (std::size_t place = 0; place < components_.size(); ++place) {
    ComponentCore* const component = components_[place].get();
    if (runs_elsewhere(component->name)) {
      rings.push_back(nullptr);
      continue;
    }
    if (auto shared = is_for_peers ? peers_->reads_of(place) : nullptr) {
      component->keep_reads(std::move(shared));
      rings.push_back(component->publishing.reads);
      continue;
    }
    // Credits are queried in each activation, and there may be thousands between two reads of the
    // ring.
    const bool learns_much = component->subscriptions.has_views() ||
                             std::ranges::any_of(component->declared.publishers, has_credits);
    component->keep_reads(std::make_unique<detail::ReadRing>(
        learns_much ? detail::ReadRing::kForViews : detail::ReadRing::kWithoutViews));
    rings.push_back(component->publishing.reads);
  }
  return rings;
}

/// The time of the recording. Of several processes all have to show the same: until all have
/// started theirs stand, as they do in simulated time.
void Application::begin_clock_of_replay() {
  if (peers_ == nullptr || driver_->is_simulated()) {
    clock_.restart(replay_->begin());
    return;
  }
  clock_.stand_at(replay_->begin());
  if (const std::optional<std::int64_t> began_ns = peers_->clocks_began()) {
    clock_.go_on_at(*began_ns);
    replay_->skip_to(clock_.now());
  }
}

std::vector<base::Refusal> Application::start(std::optional<Duration> within) {
  const std::int64_t deadline_ns = within ? deadline_in(*within) : base::kNever;
  if (replay_ != nullptr) {
    begin_clock_of_replay();
    replay_->start(clock_, own_log_, [this](ReplayEnd end) {
      if (end == ReplayEnd::kOver && peers_ != nullptr && !driver_->is_simulated()) {
        peers_->reach_end_of_input([this] { return replay_->is_stopping(); });
      }
      request_end(end == ReplayEnd::kFailed ? EndReason::kReplayFailed
                                            : EndReason::kSourcesFinished);
    });
    driver_->set_feed(*replay_);
  }
  if (injector_ != nullptr) {
    if (replay_ != nullptr) {
      injector_->set_other(*replay_);
    }
    driver_->set_feed(*injector_);
  }
  start_ns_ = base::to_ns(clock_.now());
  if (peers_ != nullptr) {
    if (const std::optional<std::int64_t> began_ns = peers_->clocks_began()) {
      log_queue_.set_start(clock_.at_monotonic(*began_ns));
    }
    params_.send_all();
    peer_news_.begin();
    peer_log_.begin();
  }
  if (driver_->is_real_time()) {
    if (auto refused = base::lock_memory_as_touched()) {
      refusals_.push_back(std::move(*refused));
    }
  }
  if (shares_rounds()) {
    driver_->set_peers(*peers_->rounds());
  }
  std::vector<const detail::PeerActivity*> elsewhere;
  if (peers_ != nullptr && peers_->keeps_activity()) {
    driver_->use_rings(peers_->rings());
    elsewhere = peers_->activity_elsewhere();
  }
  driver_->start(refusals_);
  observers_.start(*this, *driver_, keep_reads(), std::move(elsewhere), refusals_);
  is_started_ = true;
  wiring_.begin();
  if (!lifecycle_.start(deadline_ns)) {
    return refusals_;
  }
  start_ns_ = base::to_ns(begin_of_timers());
  log_queue_.set_start(peers_ == nullptr ? start_time() : peers_->began());
  lifecycle_.start_timers(start_time());
  if (injector_ != nullptr) {
    log(LogLevel::kWarning, {}, injector_->summary());
    injector_->begin(peers_ == nullptr ? start_time() : peers_->began(), refusals_);
  }
  modes_.begin();
  if (peers_ != nullptr) {
    peer_news_.send_all();
  }
  lifecycle_.start_threads(refusals_);
  if (replay_ != nullptr && !driver_->is_simulated()) {
    replay_->start_thread(refusals_);
  }
  return refusals_;
}

EndReason Application::run(std::optional<Duration> limit) {
  if (end_reason() != EndReason::kNone && !shares_rounds()) {
    return end_reason();
  }
  const Time end = limit ? start_time() + *limit : Time::max();
  switch (driver_->run(end, replay_ != nullptr ? replay_->end() : Time::max())) {
    case TimeDriver::End::kReached:
      request_end(EndReason::kTimeOver);
      break;
    case TimeDriver::End::kInputOver:
      request_end(EndReason::kSourcesFinished);
      break;
    case TimeDriver::End::kIdle:
      request_end(EndReason::kIdle);
      break;
    case TimeDriver::End::kStuck:
      log(LogLevel::kError, {},
          "simulated time does not advance: components answer each other without end at one "
          "moment; let one of them answer from a timer");
      request_end(EndReason::kStuck);
      break;
    case TimeDriver::End::kInterrupted:
      if (shares_rounds() ? peers_->agreed_end() == Peers::AgreedEnd::kInputOver
                          : end_reason() == EndReason::kSourcesFinished) {
        driver_->settle();  // Consequences of the last input belong to the run.
      }
      break;
  }
  return end_reason();
}

void Application::request_end(EndReason reason) {
  // The exit code must report a fault; otherwise the first reason is kept.
  EndReason now = end_reason_.load();
  while ((now == EndReason::kNone || is_failure(reason)) &&
         !end_reason_.compare_exchange_weak(now, reason)) {
  }
  driver_->interrupt();
}

void Application::stop() {
  if (std::exchange(is_stopped_, true)) {
    return;
  }
  status_.end();
  if (peers_ != nullptr) {
    peers_->stops();
  }
  reloads_.end();
  wiring_.end();
  if (is_started_) {
    modes_.end();
    if (replay_ != nullptr) {
      replay_->stop();
    }
    lifecycle_.stop_threads();
    // In simulated time also what a replayed component published while it stopped comes again.
    wiring_.close_external(
        [this](const ComponentCore& component) { return is_replayed(component.name); });
    lifecycle_.stop_timers();
    if (injector_ != nullptr) {
      injector_->end();
    }
    if (peers_ != nullptr) {
      // Messages in progress here may cause others in another process, and return.
      peers_->reach(Peers::Step::kTimersStopped);
      lifecycle_.drain();
      peers_->reach(Peers::Step::kDrained);
      lifecycle_.drain();
      peers_->reach(Peers::Step::kDrainedAgain);
    }
    lifecycle_.drain();
    end_time_ = clock_.now();
    lifecycle_.stop_components();
    if (peers_ != nullptr) {
      peers_->end();
    }
    lifecycle_.finish();
  }
  params_.end();
  if (peers_ != nullptr) {
    peer_log_.end();
    peers_->stop_notices();
  }
  driver_->stop([this](const detail::Actor& actor) { return lifecycle_.is_stuck(actor); });
  if (peers_ != nullptr) {
    peers_->count_rest();
  }
  observers_.stop(*this);
  destroy_components([this](const ComponentCore& component) {
    return driver_->may_serve(component) || lifecycle_.is_stuck(component);
  });
}

void Application::destroy_components(
    const std::function<bool(const ComponentCore&)>& is_left_alone) {
  for (auto component = components_.rbegin(); component != components_.rend(); ++component) {
    if (!is_left_alone(**component)) {
      (*component)->close(detail::DropReason::kShutdown);
      (*component)->destroy();
      (*component)->release_callbacks();
    }
  }
}

// ---- Notifications from components ----

bool Application::may_end_process(const ComponentCore& component) const {
  if (peers_ == nullptr || peers_->is_main()) {
    return false;
  }
  const auto& processes = description_.processes;
  const auto its = std::ranges::find(processes, component.description.process,
                                     &config::ProcessDescription::name);
  return its != processes.end() && its->on_exit == config::OnExit::kRestart;
}

void Application::end_process(ComponentCore& component, const std::string& what) {
  // Notices sent here are read after the end of this process.
  peer_news_.send_end(component);
  // Printed directly, since the log may not be written any more.
  std::fputs(fmt::format("\nfastcycle: component \"{}\": {}\n", component.name, what).c_str(),
             stderr);
  std::fflush(stderr);
  diagnostics::end_process(1);
}

void Application::component_changed(ComponentCore& component, bool is_urgent) {
  if (component.publishing.is_following) {
    return;  // The followed instance reports it.
  }
  if (observers_.wants_changes()) {
    observers_.changed(news_of(component));
  }
  status_.changed(component, is_urgent);
  if (peers_ != nullptr) {
    peer_news_.changed(component, is_urgent);
  }
}

void Application::chain_breached(ComponentCore& sink, std::size_t chain) {
  chains_.breached(sink, chain);
  reloads_.chain_breached(chain);
  if (sink.publishing.is_following) {
    return;
  }
  if (driver_->is_simulated()) {
    status_.changed(sink, false);
  }
  if (peers_ != nullptr) {
    peer_news_.changed(sink, false);
  }
}

void Application::version_changed(ComponentCore& component) {
  component_changed(component, true);
  if (peers_ != nullptr) {
    params_.send_all();  // Another class may declare others.
  }
}

void Application::hang_changed(ComponentCore& component, std::string hang) {
  if (!hang.empty()) {
    component.versions->note_hang(hang);
  }
  component.set_hang(std::move(hang));
  if (!driver_->is_simulated()) {
    status_.mode_changed();  // Simulated time cannot advance before the call returns.
    if (peers_ != nullptr) {
      peer_news_.hang_changed(component);
    }
  }
}

/// Executes a fault of a component or a process.
namespace {

/// Allocates memory that is used, and never freed.
void leak(std::uint64_t bytes) {
  constexpr std::uint64_t kPiece = 1'000'000;
  static std::mutex mutex;
  static auto& leaked = *new std::vector<std::vector<char>>;
  for (std::uint64_t left = bytes; left > 0; left -= std::min(left, kPiece)) {
    std::vector<char> piece(std::min(left, kPiece), 'x');
    const std::lock_guard lock(mutex);
    leaked.push_back(std::move(piece));
  }
}

}  // namespace

void Application::strike(const config::FaultDescription& fault, bool is_over) {
  if (fault.kind == config::FaultKind::kKill || fault.kind == config::FaultKind::kSuspend) {
    if (peers_ != nullptr && peers_->name() == fault.process) {
      std::raise(fault.kind == config::FaultKind::kKill ? SIGKILL : SIGSTOP);
    }
    return;
  }
  const auto found = std::ranges::find(components_, fault.component,
                                       [](const auto& component) { return component->name; });
  if (found == components_.end() || is_replayed(fault.component)) {
    return;  // It is in another process, or does not run.
  }
  ComponentCore& component = **found;
  if (fault.kind != config::FaultKind::kSlow && peers_ != nullptr &&
      !peers_->is_here(peers_->process_of(component.name))) {
    return;  // A standby, which would meet the fault when it takes over.
  }
  const bool is_simulated = driver_->is_simulated();
  if (is_simulated ? fault.kind == config::FaultKind::kHang
                   : fault.kind == config::FaultKind::kSlow) {
    log(LogLevel::kWarning, component.name,
        "the fault \"" + fault.name + "\" does nothing in a " +
            (is_simulated ? "simulated" : "live") + " run");
    return;
  }
  switch (fault.kind) {
    case config::FaultKind::kThrow:
      driver_->between_rounds([&component, what = "the injected fault \"" + fault.name + "\""] {
        component.post_fault(ComponentCore::kAnyObject, what);
      });
      break;
    case config::FaultKind::kCrash:
      driver_->between_rounds(
          [&component] { component.post(detail::Cause::kEvent, [] { std::raise(SIGSEGV); }); });
      break;
    case config::FaultKind::kLeak:
      driver_->between_rounds([&component, bytes = fault.by_bytes] {
        component.post(detail::Cause::kEvent, [bytes] { leak(bytes); });
      });
      break;
    case config::FaultKind::kRestart:
      change_life(component, detail::LifeStep::kRenew, [](const auto&, const auto&) {});
      break;
    case config::FaultKind::kSlow:
      component.set_simulated_cost(component.simulated_cost() + (is_over ? -fault.by : fault.by));
      break;
    case config::FaultKind::kHang:
      component.post(detail::Cause::kEvent, [by = fault.by] { std::this_thread::sleep_for(by); });
      break;
    default:
      break;
  }
}

void Application::fault_noted(const ComponentCore& component, std::string_view what) {
  observers_.faulted(component.name, what);
}

bool Application::sources_are_finished() const {
  if (replay_ != nullptr) {
    return false;  // It ends with the recording.
  }
  bool has_source = false;
  for (const auto& component : components_) {
    if (component->is_source.load()) {
      has_source = true;
      if (!component->is_source_finished.load()) {
        return false;
      }
    }
  }
  return has_source;
}

void Application::source_finished(ComponentCore& component) {
  component.is_source_finished = true;
  if (!sources_are_finished()) {
    return;
  }
  if (peers_ != nullptr) {
    peers_->sources_finished();
  } else {
    request_end(EndReason::kSourcesFinished);
  }
}

void Application::component_failed(ComponentCore& component) {
  if (component.is_source.load() && !component.is_source_finished.load()) {
    source_finished(component);
  }
}

}  // namespace fastcycle::host

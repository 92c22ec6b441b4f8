#include "host/application.h"

#include <algorithm>
#include <chrono>
#include <future>
#include <iterator>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "base/memory.h"
#include "config/nearest.h"
#include "config/params.h"
#include "host/call_head.h"
#include "host/credits.h"
#include "host/explanation.h"
#include "host/guest.h"
#include "host/pace.h"
#include "host/recording.h"
#include "host/replay.h"
#include "host/services.h"
#include "host/status.h"
#include "host/steps.h"
#include "host/wait.h"

namespace fastcycle::host {

using detail::Cause;
using detail::ComponentCore;
using namespace std::chrono_literals;

namespace {

constexpr auto kDrainLimit = 1s;
constexpr const char* kPoolName = "pool";  // Of those that name no executor.

unsigned cpu_count() {
  return std::max(1U, std::thread::hardware_concurrency());
}

base::SchedulingPolicy to_policy(config::Policy policy) {
  switch (policy) {
    case config::Policy::kFifo:
      return base::SchedulingPolicy::kFifo;
    case config::Policy::kRr:
      return base::SchedulingPolicy::kRoundRobin;
    case config::Policy::kOther:
      break;
  }
  return base::SchedulingPolicy::kOther;
}

detail::WaitMode to_wait(config::Wait wait) {
  switch (wait) {
    case config::Wait::kSpin:
      return detail::WaitMode::kSpin;
    case config::Wait::kAdaptive:
      return detail::WaitMode::kAdaptive;
    case config::Wait::kPark:
      break;
  }
  return detail::WaitMode::kPark;
}

/// Tells guests of full queues.
class OverflowTeller final : public detail::OverflowWatch {
 public:
  explicit OverflowTeller(std::vector<Guest*> guests) : guests_(std::move(guests)) {}

  void overflowed(const detail::Subscription& subscription) noexcept override {
    for (Guest* guest : guests_) {
      guest->overflowed(subscription);
    }
  }

 private:
  const std::vector<Guest*> guests_;
};

base::Clock make_clock(const ClockOptions& options) {
  return options.is_simulated ? base::Clock::simulated() : base::Clock::live(options.rate);
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
    : description_(std::move(description)), clock_(make_clock(options)) {
  if (options.is_simulated) {
    simulation_ = std::make_unique<detail::Simulation>(
        clock_, options.workers == 0 ? cpu_count() : options.workers);
  } else {
    make_executors();
  }
  topics_.set_default_options(kStatusTopic, {.latched = 1, .ages = false});
  for (const config::TopicDescription& topic : description_.topics) {
    topics_.set_options(topic.name, {.latched = static_cast<std::size_t>(topic.latched),
                                     .ages = topic.ages,
                                     .keep = topic.keep,
                                     .pool_max = topic.pool_max.value_or(0),
                                     .multiple_publishers = topic.multiple_publishers,
                                     .external = topic.external,
                                     .lifespan = topic.lifespan,
                                     .credits = topic.credits});
  }
  chains_.declare(topics_);
}

Application::~Application() {
  stop();
}

void Application::make_executors() {
  for (const config::ExecutorDescription& executor : description_.executors) {
    executors_.push_back(std::make_unique<detail::Executor>(
        detail::ExecutorOptions{.name = executor.name,
                                .threads = static_cast<unsigned>(executor.threads),
                                .cpus = executor.cpus,
                                .policy = to_policy(executor.policy),
                                .priority = executor.priority,
                                .wait = to_wait(executor.wait),
                                .hand_over = executor.hand_over}));
  }
  if (needs_pool()) {
    executors_.push_back(std::make_unique<detail::Executor>(detail::ExecutorOptions{
        .name = kPoolName, .threads = std::min(cpu_count(), 64U), .cpus = {}}));
  }
}

bool Application::needs_pool() const {
  return std::any_of(description_.components.begin(), description_.components.end(),
                     [](const auto& component) { return component.executor.empty(); });
}

detail::Executor& Application::executor_of(const config::ComponentDescription& component) {
  for (const auto& executor : executors_) {
    if (executor->options().name == component.executor) {
      return *executor;
    }
  }
  return *executors_.back();
}

void Application::add_component(const config::ComponentDescription& component,
                                const ComponentClass& its_class) {
  auto core = std::make_unique<ComponentCore>(*this, static_cast<std::uint32_t>(components_.size()),
                                              component, its_class, clock_);
  core->is_wanted = modes_.is_active_at_first(core->index);
  core->set_root_count(chains_.root_count());
  if (simulation_ != nullptr) {
    core->set_simulated_cost(component.simulated_cost);
    simulation_->add(*core);
  } else {
    executor_of(component).add(*core);
  }
  components_.push_back(std::move(core));
}

void Application::build(ComponentClasses& classes, config::Problems& problems,
                        ConstructorFault on_throw) {
  modes_.resolve(problems);
  for (const config::ComponentDescription& component : description_.components) {
    if (const ComponentClass* its_class = classes.find(component, problems)) {
      add_component(component, *its_class);
    }
  }
  std::set<std::string> declared;
  for (const auto& component : components_) {
    if (before_construct) {
      before_construct(component->name);
    }
    const auto thrown = component->construct(problems);
    declared.merge(component->declared_params);
    if (!thrown) {
      continue;
    }
    const std::string what = "its constructor threw: " + *thrown;
    if (on_throw == ConstructorFault::kMistake) {
      problems.add(config::mistake(component->description.place,
                                   "component \"" + component->name + "\": " + what));
    } else if (!problems.has_errors()) {
      component->fail(what);
    }
  }
  const bool is_complete = components_.size() == description_.components.size();
  if (is_complete) {
    start_order_ = config::start_order(description_);
    check_own_topics(problems);
    add_status(problems);
    if (replay_ == nullptr) {  // Else those who use them may not run.
      config::check_shared(description_.shared_params, declared, problems);
    }
    service_names_ = connect_services(*this, problems);
    add_conflicts(problems);
    add_quality_conflicts(problems);
    check_credits(*this, problems);
    chains_.check(problems);
    if (const auto& record = recorded_ ? recorded_ : description_.record) {
      check_patterns(*record, topics_, problems);
    }
    if (const auto& kept = kept_ ? kept_ : description_.flight_recorder) {
      check_patterns(*kept, topics_, problems);
    }
  }
  if (problems.has_errors()) {
    return;
  }
  std::ranges::copy_if(guests_, std::back_inserter(hearing_guests_),
                       [](const Guest* guest) { return guest->wants_changes(); });
  for (Guest* guest : guests_) {
    guest->tap(topics_);
  }
  watch_overflows();
  topics_.connect_all();
  for (Guest* guest : guests_) {
    guest->open(problems);
  }
  for (const auto& component : components_) {
    if (component->state == ComponentCore::State::kFailed) {
      component->close(detail::DropReason::kFault);
    }
  }
  is_built_ = !problems.has_errors();
}

config::Place Application::place_of(const std::string& name) const {
  for (const config::ComponentDescription& component : description_.components) {
    if (component.name == name) {
      return component.place;
    }
  }
  return description_.place;
}

/// What subscribers ask for and publishers do not offer: all runs, but not as it was meant.
void Application::add_quality_conflicts(config::Problems& problems) const {
  const auto in_ms = [](Duration span) {
    return fmt::format("{} ms", std::chrono::duration<double, std::milli>(span).count());
  };
  for (const auto& component : components_) {
    for (const auto& offered : component->offered) {
      const detail::Topic& topic = offered->publisher.topic;
      for (const auto& subscription : topic.subscriptions) {
        const auto asked =
            subscription->quality == nullptr ? std::nullopt : subscription->quality->deadline();
        if (!asked || *asked >= offered->period()) {
          continue;
        }
        config::Problem problem;
        problem.place = place_of(subscription->component);
        problem.expected = "at least " + in_ms(offered->period());
        problem.found = in_ms(*asked);
        problem.message = "component \"" + subscription->component + "\" wants a message of \"" +
                          topic.name + "\" every " + in_ms(*asked) + ", component \"" +
                          component->name + "\" promises one only every " +
                          in_ms(offered->period());
        problem.warning = true;
        problems.add(std::move(problem));
      }
    }
  }
}

void Application::check_own_topics(config::Problems& problems) const {
  if (own_topics_are_free) {
    return;
  }
  for (const auto& component : components_) {
    for (const detail::PublisherCore* publisher : component->declared.publishers) {
      if (publisher->topic.name.starts_with(kOwnTopics) && component->name != kOwnName) {
        problems.add(config::mistake(component->description.place,
                                     "component \"" + component->name + "\" publishes on \"" +
                                         publisher->topic.name + "\", but what begins with \"" +
                                         kOwnTopics + "\" only FastCycle itself publishes"));
      }
    }
  }
}

bool Application::is_status_wanted() const {
  const detail::Topic* topic = topics_.find(kStatusTopic);
  if (topic != nullptr && !topic->publishers.empty()) {
    return false;  // A recording, or a test, publishes it.
  }
  const auto names_it = [](const std::vector<std::string>& patterns) {
    return std::ranges::any_of(patterns, [](const std::string& pattern) {
      return pattern == kStatusTopic || pattern == std::string("/") + kStatusTopic;
    });
  };
  const auto& record = recorded_ ? recorded_ : description_.record;
  const auto& kept = kept_ ? kept_ : description_.flight_recorder;
  return (topic != nullptr && !topic->subscriptions.empty()) ||
         (record && names_it(record->topics)) || (kept && names_it(kept->topics));
}

/// As the last one, so that the numbers of the others do not depend on who looks on.
void Application::add_status(config::Problems& problems) {
  if (!is_status_wanted()) {
    return;
  }
  add_component(describe_status(description_), status_class());
  status_ = components_.back().get();
  start_order_.push_back(status_->index);
  if (simulation_ != nullptr) {
    simulation_->set_watcher(*status_);
  }
  static_cast<void>(status_->construct(problems));
}

void Application::component_changed(ComponentCore& component, bool is_urgent) {
  if (!hearing_guests_.empty()) {
    const ComponentNews news = news_of(component);
    for (Guest* guest : hearing_guests_) {
      guest->changed(news);
    }
  }
  if (status_ == nullptr || &component == status_ || is_stopped_) {
    return;
  }
  ComponentNews news = news_of(component);
  news.is_urgent = is_urgent;
  status_->post(
      Cause::kEvent,
      [status = status_, news = std::move(news)] {
        if (status->component != nullptr) {
          static_cast<StatusComponent*>(status->component)->hear(news);
        }
      },
      &component);
}

void Application::mode_changed() {
  if (status_ == nullptr || is_stopped_) {
    return;
  }
  status_->post(Cause::kEvent, [status = status_] {
    if (status->component != nullptr) {
      static_cast<StatusComponent*>(status->component)->say();
    }
  });
}

void Application::add_conflicts(config::Problems& problems) const {
  std::vector<std::string> published;
  for (const auto& [name, topic] : topics_.all()) {
    if (!topic->publishers.empty()) {
      published.push_back(name);
    }
  }
  for (const detail::TopicConflict& conflict : topics_.conflicts()) {
    config::Problem problem;
    problem.place = place_of(conflict.component);
    const std::string topic = "topic \"" + conflict.topic + "\"";
    switch (conflict.kind) {
      case detail::TopicConflict::Kind::kTwoTypes:
        problem.expected = conflict.other_type;
        problem.found = conflict.type;
        problem.message = topic + " has two types: component \"" + conflict.component +
                          "\" uses it as " + conflict.type + ", component \"" + conflict.other +
                          "\" as " + conflict.other_type;
        break;
      case detail::TopicConflict::Kind::kTwoPublishers:
        problem.expected = "one publisher";
        problem.found = "\"" + conflict.other + "\" and \"" + conflict.component + "\"";
        problem.message = topic + " has two publishers, \"" + conflict.other + "\" and \"" +
                          conflict.component + "\"";
        problem.hint = "if that is meant, say \"topics\": {\"" + conflict.topic +
                       "\": {\"multiple_publishers\": true}}";
        break;
      case detail::TopicConflict::Kind::kNoPublisher:
        if (conflict.topic.find(detail::kServiceMark) != std::string::npos) {
          continue;  // A service that nobody gives, or calls: told as such.
        }
        problem.message = topic + ", which component \"" + conflict.component +
                          "\" subscribes to, is published by nobody";
        problem.hint = config::did_you_mean(config::nearest(conflict.topic, published));
        problem.warning = true;
        break;
    }
    problems.add(std::move(problem));
  }
  for (const config::TopicDescription& topic : description_.topics) {
    const detail::Topic* known = topics_.find(topic.name);
    if (known != nullptr && known->publishers.empty() && known->subscriptions.empty()) {
      config::Problem problem =
          config::mistake(topic.place, "topic \"" + topic.name + "\" is used by no component",
                          config::did_you_mean(config::nearest(topic.name, published)));
      problem.warning = true;
      problems.add(std::move(problem));
    }
  }
}

void Application::run_in(ComponentCore& component, Cause cause, std::function<void()> body) {
  if (simulation_ != nullptr) {
    component.post(cause, std::move(body));
    simulation_->run_now();
    return;
  }
  std::promise<void> done;
  // Once what it threw is handled too: who waits asks what became of the component.
  component.post_and_tell(cause, std::move(body), [&done] { done.set_value(); });
  done.get_future().wait();
}

void Application::start_component(ComponentCore& component) {
  using Stage = ComponentCore::Start::Stage;
  if (component.state != ComponentCore::State::kConstructed) {
    return;
  }
  const auto start = [&component] { component.call_start(); };
  if (simulation_ != nullptr || component.description.start_timeout.count() == 0) {
    run_in(component, Cause::kMode, start);
    return;
  }
  ComponentCore::Start& its = component.first_start;
  // Also where it threw: then somebody has noted that already.
  component.post_and_tell(Cause::kMode, start, [&its] { its.set(Stage::kDone); });
  std::unique_lock lock(its.mutex);
  its.changed.wait(lock, [&] { return its.stage != Stage::kWaiting; });
  if (its.changed.wait_for(lock, component.description.start_timeout,
                           [&] { return its.stage != Stage::kCalled; })) {
    its.changed.wait(lock, [&] { return its.stage == Stage::kDone; });
    return;
  }
  // It becomes a fault of the component as soon as its worker is back; the others do not wait.
  its.stage = Stage::kLate;
  lock.unlock();
  log(LogLevel::kError, component.name, component.late_start());
  if (component.description.on_fault == config::OnFault::kStop) {
    request_end(EndReason::kFault);
  }
}

/// In simulated time: what follows, at the present moment, has rounds with numbers of its own.
void Application::begin_part(std::uint32_t part) {
  if (simulation_ != nullptr) {
    simulation_->begin_steps(part * kStepsOfPart, (part + 1) * kStepsOfPart);
  }
}

/// The same for all that is neither start nor stop.
void Application::begin_run() {
  if (simulation_ != nullptr) {
    simulation_->begin_steps(static_cast<std::uint32_t>(components_.size()) * kStepsOfPart,
                             kStopSteps);
  }
}

/// When the timers start: now, or when they did in the run that is replayed.
Time Application::begin_of_timers() {
  if (replay_ == nullptr) {
    return clock_.now();
  }
  const Time begin = replay_->begin_of_timers();
  if (simulation_ != nullptr && begin > clock_.now()) {
    advance_to(begin);  // What came while the components started, which took time then.
  }
  return begin;
}

void Application::set_pace(WallPace& pace) {
  pace_ = &pace;
  pace.on_change = [this] { simulation_->look_again(); };
  simulation_->set_pace(pace);
}

std::vector<base::Refusal> Application::start() {
  if (replay_ != nullptr) {
    clock_.restart(replay_->begin());
    replay_->start(*this);
    if (simulation_ != nullptr) {
      simulation_->set_feed(*replay_);
    }
  }
  if (pace_ != nullptr) {
    pace_->begin(clock_.now());
  }
  start_ns_ = base::to_ns(clock_.now());
  if (is_real_time()) {
    if (auto refused = base::lock_memory_as_touched()) {
      refusals_.push_back(std::move(*refused));
    }
  }
  for (const auto& executor : executors_) {
    executor->start(refusals_);
  }
  start_guests();
  is_started_ = true;
  for (const auto& component : components_) {
    for (detail::PublisherCore* publisher : component->declared.publishers) {
      if (publisher->options.is_external) {
        const std::lock_guard lock(publisher->mutex());
        publisher->set_external_stage(simulation_.get());
        publisher->set_external_open(true);
      }
    }
  }
  std::uint32_t part = 0;
  for (const std::size_t next : start_order_) {
    if (end_reason() == EndReason::kFault || end_reason() == EndReason::kRequested) {
      return refusals_;
    }
    begin_part(part++);
    start_component(*components_[next]);
  }
  begin_run();
  start_ns_ = base::to_ns(begin_of_timers());
  const Time start = start_time();
  for (const auto& component : components_) {
    component->post(Cause::kMode, [&component, start] {
      if (component->state == ComponentCore::State::kActive) {
        component->start_timers(start);
      }
    });
  }
  modes_.begin();
  start_threads();
  return refusals_;
}

void Application::record(const config::RecordDescription& description) {
  recorded_ = description;
  recorder_ = std::make_unique<RecorderGuest>(*this, description);
  add(*recorder_);
}

const record::Recorder* Application::recorder() const {
  return recorder_ == nullptr ? nullptr : &recorder_->recorder();
}

void Application::keep_last(const config::FlightRecorderDescription& description) {
  kept_ = description;
  flight_recorder_ = std::make_unique<FlightGuest>(*this, description);
  add(*flight_recorder_);
}

const record::FlightRecorder* Application::flight_recorder() const {
  return flight_recorder_ == nullptr ? nullptr : &flight_recorder_->recorder();
}

bool Application::dump(std::string_view reason, std::string_view component,
                       std::string_view detail) noexcept {
  if (flight_recorder_ == nullptr) {
    return false;
  }
  flight_recorder_->dump(reason, component, detail);
  return true;
}

record::Explanation Application::explanation() const {
  record::Explanation explanation = explain(*this);
  if (replay_ != nullptr) {
    replay_->explain(explanation.facts);
  }
  return explanation;
}

void Application::fault_noted(const ComponentCore& component, std::string_view what) {
  for (Guest* guest : guests_) {
    guest->faulted(component.name, what);
  }
}

void Application::watch_overflows() {
  std::vector<Guest*> guests;
  std::ranges::copy_if(guests_, std::back_inserter(guests),
                       [](const Guest* guest) { return guest->wants_overflows(); });
  if (!guests.empty()) {
    overflow_watch_ = std::make_unique<OverflowTeller>(std::move(guests));
    topics_.set_overflow_watch(*overflow_watch_);
  }
}

void Application::start_guests() {
  if (guests_.empty()) {
    return;
  }
  GuestView view{.application = *this, .rings = {}};
  const auto add_rings = [&](const auto& server) {
    for (const auto& ring : server.rings()) {
      view.rings.push_back(ring.get());
    }
  };
  if (simulation_ != nullptr) {
    add_rings(*simulation_);
    simulation_->after_round = [this](std::uint32_t step) {
      for (Guest* guest : guests_) {
        guest->round_ended(step);
      }
    };
  }
  for (const auto& executor : executors_) {
    add_rings(*executor);
  }
  for (Guest* guest : guests_) {
    guest->start(view, refusals_);
  }
}

bool Application::is_real_time() const {
  const auto has_priority = [](const config::ComponentDescription& component) {
    return std::ranges::any_of(component.threads, [](const auto& thread) {
      return thread.second.policy != config::Policy::kOther;
    });
  };
  return std::ranges::any_of(executors_,
                             [](const auto& executor) {
                               return executor->options().policy != base::SchedulingPolicy::kOther;
                             }) ||
         (simulation_ == nullptr && std::ranges::any_of(description_.components, has_priority));
}

/// How a component's own thread runs. In simulated time, where nobody waits for it, as any other.
base::ThreadOptions Application::options_of(const config::ComponentDescription& component,
                                            const std::string& thread) const {
  base::ThreadOptions options{.name = thread, .cpus = {}};
  const auto described = component.threads.find(thread);
  if (simulation_ == nullptr && described != component.threads.end()) {
    options.cpus = described->second.cpus;
    options.policy = to_policy(described->second.policy);
    options.priority = described->second.priority;
  }
  return options;
}

void Application::start_threads() {
  for (const auto& component : components_) {
    if (!component->has_started()) {
      continue;
    }
    for (const auto& thread : component->threads) {
      if (simulation_ != nullptr) {
        simulation_->foreign_thread_begins();
      }
      running_threads_.fetch_add(1);
      threads_.emplace_back(
          options_of(component->description, thread.name),
          [this, &component, &thread, token = thread_stop_.get_token()] {
            // Last of all: until then a simulation, and the end of the run, wait for what comes
            // from here.
            const auto end = [](Application* application) {
              if (application->simulation_ != nullptr) {
                application->simulation_->foreign_thread_ends();
              }
              application->running_threads_.fetch_sub(1);
            };
            const std::unique_ptr<Application, decltype(end)> guard(this, end);
            std::string what;
            try {
              thread.body(token);
              return;
            } catch (const std::exception& exception) {
              what = exception.what();
            } catch (...) {
              what = "something that is no std::exception";
            }
            component->post(Cause::kFault, [text = "its thread \"" + thread.name + "\" threw: " +
                                                   what] { throw std::runtime_error(text); });
          },
          refusals_);
    }
  }
  if (replay_ != nullptr && simulation_ == nullptr) {
    replay_->start_thread(refusals_);
  }
}

void Application::stop_threads() {
  thread_stop_.request_stop();
  if (replay_ != nullptr) {
    replay_->stop();
  }
  // One that waits for its device ends when `stop` of its component closes that.
  wait_up_to(kDrainLimit, [this] { return running_threads_.load() == 0; });
  for (const auto& component : components_) {
    if (replay_ != nullptr && !replay_->plan().runs(component->name)) {
      continue;  // In simulated time also what it published while it stopped comes again.
    }
    for (detail::PublisherCore* publisher : component->declared.publishers) {
      if (publisher->options.is_external) {
        const std::lock_guard lock(publisher->mutex());
        publisher->set_external_open(false);
      }
    }
  }
}

void Application::request_end(EndReason reason) {
  {
    const std::lock_guard lock(end_mutex_);
    // A fault is what the exit code must tell; otherwise the first reason stands.
    if (end_reason_ == EndReason::kNone || is_failure(reason)) {
      end_reason_ = reason;
    }
    end_changed_.notify_all();
  }
  if (simulation_ != nullptr) {
    simulation_->interrupt();
  }
}

bool Application::sources_are_finished() const {
  if (replay_ != nullptr) {
    return false;  // It is over when the recording is.
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

detail::CallbackSubscription& Application::subscribe_late(
    ComponentCore& component, const std::string& name,
    const google::protobuf::Message& default_instance, const SubscriberOptions& options,
    detail::EnvelopeCallback callback) {
  const std::lock_guard lock(topics_mutex_);
  detail::Topic* known = topics_.find(name);
  const std::string type = default_instance.GetTypeName();
  if (known != nullptr && !known->type.empty() && known->type != type) {
    throw std::runtime_error("topic \"" + name + "\" has the type " + known->type + ", not " +
                             type);
  }
  detail::Topic& topic = topics_.get(name, component.name, default_instance);
  auto& subscription = component.subscribe_again(topic, options, std::move(callback));
  for (const auto& publisher : topic.publishers) {
    connect_late(component, *publisher, subscription);
  }
  return subscription;
}

void Application::connect_late(ComponentCore& component, detail::PublisherCore& publisher,
                               detail::CallbackSubscription& subscription) {
  const auto lane = detail::Topics::make_lane(publisher, subscription);
  component.inbox.add(lane);
  if (publisher.options.is_external) {
    const std::lock_guard lock(publisher.mutex());
    publisher.connect(lane, component.inbox);
    return;
  }
  run_at(publisher, component,
         [&publisher, lane, &inbox = component.inbox] { publisher.connect(lane, inbox); });
}

void Application::run_at(detail::PublisherCore& publisher, ComponentCore& from,
                         std::function<void()> action) {
  ComponentCore& owner = component_of(publisher);
  if (simulation_ != nullptr) {
    // What reaches another component waits until the round is over, latched messages too.
    action = [&owner, staged = std::move(action)] { owner.stage(staged); };
  }
  owner.post(Cause::kConnect, std::move(action), &from);
}

void Application::beside(detail::PublisherCore& publisher, std::function<void()> action) {
  if (simulation_ != nullptr) {
    simulation_->call(std::move(action));
  } else if (publisher.options.is_external) {
    const std::lock_guard lock(publisher.mutex());
    action();
  } else {
    component_of(publisher).post(Cause::kConnect, std::move(action));
  }
}

void Application::reopen_subscription(ComponentCore& component,
                                      detail::CallbackSubscription& subscription) {
  if (!std::exchange(subscription.is_ended, false)) {
    return;
  }
  const std::lock_guard lock(topics_mutex_);
  for (const auto& publisher : subscription.topic.publishers) {
    connect_late(component, *publisher, subscription);
  }
}

void Application::end_subscription(ComponentCore& component,
                                   detail::CallbackSubscription& subscription,
                                   detail::DropReason reason) noexcept {
  if (subscription.is_ended) {
    return;
  }
  component.end(subscription, reason);
  for (const auto& lane : subscription.lanes()) {
    component.inbox.remove(*lane);
    lane->is_left_by_receiver = true;
  }
  const std::lock_guard lock(topics_mutex_);
  for (const auto& publisher : subscription.topic.publishers) {
    const auto leave = [&publisher, lanes = subscription.lanes()] {
      for (const auto& lane : lanes) {
        publisher->disconnect(*lane);
      }
    };
    if (publisher->options.is_external) {
      const std::lock_guard publisher_lock(publisher->mutex());
      leave();
    } else if (is_started_ && !is_stopped_) {
      run_at(*publisher, component, leave);
    }
  }
}

ComponentCore& Application::component_of(const detail::PublisherCore& publisher) const {
  const auto found = std::find_if(
      components_.begin(), components_.end(),
      [&](const auto& component) { return &component->publishing == &publisher.owner; });
  return **found;
}

void Application::source_finished(ComponentCore& component) {
  component.is_source_finished = true;
  if (sources_are_finished()) {
    request_end(EndReason::kSourcesFinished);
  }
}

void Application::component_failed(ComponentCore& component) {
  if (component.is_source.load() && !component.is_source_finished.load()) {
    source_finished(component);
  }
}

void Application::tell_liveliness(ComponentCore& component, bool is_alive,
                                  std::string_view reason) {
  if (!is_started_) {
    return;
  }
  const std::lock_guard lock(topics_mutex_);
  for (const detail::PublisherCore* publisher : component.declared.publishers) {
    for (const auto& subscription : publisher->topic.subscriptions) {
      if (subscription->kind != detail::Subscription::Kind::kCallback ||
          subscription->quality == nullptr || !subscription->quality->has_callback()) {
        continue;
      }
      auto& to = static_cast<detail::CallbackSubscription&>(*subscription);
      auto& receiver = static_cast<ComponentCore&>(to.actor);
      const auto tell = [&to, &receiver, id = publisher->id, is_alive, reason] {
        if (receiver.state != ComponentCore::State::kActive || to.is_ended) {
          return;
        }
        const std::int64_t now_ns = base::to_ns(receiver.publishing.now);
        const auto event = to.quality->hear(id, is_alive, reason, now_ns);
        if (const auto callback = to.quality->callback(); event && callback != nullptr) {
          (*callback)(*event);
        }
      };
      receiver.post(Cause::kEvent, tell, &component);
    }
  }
}

std::string Application::service_name(std::uint64_t id) const {
  const auto found = service_names_.find(id);
  return found == service_names_.end() ? "?" : found->second;
}

void Application::hold_time() {
  if (simulation_ != nullptr) {
    simulation_->hold();
  }
}

void Application::let_time_go() {
  if (simulation_ != nullptr) {
    simulation_->let_go();
  }
}

void Application::between_rounds(std::function<void()> action) {
  if (simulation_ != nullptr) {
    simulation_->call(std::move(action));
  } else {
    action();
  }
}

void Application::change_params(ComponentCore& component, std::vector<ParamChange> changes,
                                std::function<void(const ParamsResult&)> done) {
  const auto make = [this, &component, changes = std::move(changes), done = std::move(done),
                     object = component.restart_count] {
    const ParamsResult result = params_.make(changes, component.name);
    if (!done) {
      for (const std::string& mistake : result.mistakes) {
        log(LogLevel::kWarning, component.name, "params are not changed: " + mistake);
      }
      return;
    }
    between_rounds([&component, done, object, result] {
      component.post(Cause::kParameter, [&component, done, object, result] {
        // A restarted component is another object than the one that asked.
        const bool is_there = component.state == ComponentCore::State::kActive ||
                              component.state == ComponentCore::State::kStandby;
        if (is_there && component.restart_count == object) {
          done(result);
        }
      });
    });
  };
  if (simulation_ != nullptr) {
    component.stage(make);
  } else {
    make();
  }
}

void Application::submit(const std::string& executor, ComponentCore& from,
                         std::function<void()> job) {
  const std::vector<std::string> known = executor_names();
  const auto found = std::find(known.begin(), known.end(), executor);
  if (found == known.end()) {
    const std::string hint = config::did_you_mean(config::nearest(executor, known));
    throw std::runtime_error("there is no executor \"" + executor + "\" to offload work to" +
                             (hint.empty() ? "" : "; " + hint));
  }
  if (simulation_ != nullptr) {
    from.stage([this, job = std::move(job)] { static_cast<void>(simulation_->submit(job)); });
    return;
  }
  if (!executors_[static_cast<std::size_t>(found - known.begin())]->submit(std::move(job))) {
    throw std::runtime_error("executor \"" + executor + "\" has " +
                             std::to_string(detail::Executor::kMaxJobs) +
                             " jobs waiting and takes no more");
  }
}

std::vector<std::string> Application::executor_names() const {
  std::vector<std::string> names;
  for (const config::ExecutorDescription& executor : description_.executors) {
    names.push_back(executor.name);
  }
  if (needs_pool()) {
    names.emplace_back(kPoolName);
  }
  return names;
}

EndReason Application::run_simulated(std::optional<Duration> limit) {
  if (end_reason() != EndReason::kNone) {
    return end_reason();
  }
  simulation_->clear_interrupt();
  if (pace_ != nullptr) {
    pace_->begin(clock_.now());
  }
  const Time end = limit ? start_time() + *limit : Time::max();
  const Time input_end = replay_ != nullptr ? replay_->end() : Time::max();
  switch (simulation_->run_until(std::min(end, input_end))) {
    case detail::Simulation::End::kReached:
      request_end(input_end <= end ? EndReason::kSourcesFinished : EndReason::kTimeOver);
      break;
    case detail::Simulation::End::kIdle:
      request_end(EndReason::kIdle);
      break;
    case detail::Simulation::End::kStuck:
      log(LogLevel::kError, {},
          "simulated time does not advance: components answer each other without end at one "
          "moment; let one of them answer from a timer");
      request_end(EndReason::kStuck);
      break;
    case detail::Simulation::End::kInterrupted:
      if (end_reason() == EndReason::kSourcesFinished) {
        simulation_->run_now();  // What the last input leads to belongs to the run.
      }
      break;
  }
  return end_reason();
}

EndReason Application::run(std::optional<Duration> limit) {
  if (simulation_ != nullptr) {
    return run_simulated(limit);
  }
  std::unique_lock lock(end_mutex_);
  const auto has_ended = [&] { return end_reason_ != EndReason::kNone; };
  if (!limit) {
    end_changed_.wait(lock, has_ended);
    return end_reason();
  }
  const auto wait =
      std::chrono::nanoseconds(clock_.monotonic_at(start_time() + *limit) - base::monotonic_ns());
  if (!end_changed_.wait_for(lock, wait, has_ended)) {
    end_reason_ = EndReason::kTimeOver;
  }
  return end_reason();
}

void Application::advance_to(Time time) {
  // What would end a run, such as the end of all input, is no reason to stop here.
  do {
    simulation_->clear_interrupt();
  } while (simulation_->run_until(time) == detail::Simulation::End::kInterrupted);
}

void Application::settle() {
  simulation_->run_now();
}

bool Application::is_quiet() const {
  return std::all_of(executors_.begin(), executors_.end(),
                     [](const auto& executor) { return executor->is_quiet(); });
}

void Application::drain() {
  if (simulation_ != nullptr) {
    simulation_->run_now();
    return;
  }
  // Twice quiet in a row: between two looks nothing was under way.
  int quiet_looks = 0;
  wait_up_to(kDrainLimit, [&] {
    quiet_looks = is_quiet() ? quiet_looks + 1 : 0;
    return quiet_looks == 2;
  });
}

void Application::stop() {
  if (is_stopped_.exchange(true)) {
    return;
  }
  if (is_started_) {
    modes_.end();
    stop_threads();
    std::uint32_t part = kStopPart;
    for (const std::size_t next : start_order_) {
      begin_part(part++);
      ComponentCore& core = *components_[next];
      run_in(core, Cause::kMode, [&core] {
        core.cancel_timers();
        core.cancel_alarm();
      });
    }
    begin_part(part++);
    drain();
    end_time_ = clock_.now();
    for (auto next = start_order_.rbegin(); next != start_order_.rend(); ++next) {
      begin_part(part++);
      ComponentCore& core = *components_[*next];
      run_in(core, Cause::kMode, [&core] { core.call_stop(); });
      run_in(core, Cause::kMode, [&core] { core.close(detail::DropReason::kShutdown); });
    }
    for (base::Thread& thread : threads_) {
      thread.join();
    }
    drain();
  }
  params_.end();
  for (const auto& executor : executors_) {
    executor->stop();
  }
  for (Guest* guest : guests_) {
    guest->stop(*this);
  }
  for (auto component = components_.rbegin(); component != components_.rend(); ++component) {
    (*component)->close(detail::DropReason::kShutdown);
    (*component)->destroy();
  }
}

}  // namespace fastcycle::host

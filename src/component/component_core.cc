#include "component/component_core.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <iterator>
#include <mutex>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "component/component_host.h"
#include "component/service_topics.h"
#include "component/time_driver.h"
#include "component/words.h"
#include "config/nearest.h"

namespace fastcycle::detail {
namespace {

constexpr std::size_t kFaultsInWords = 16;
constexpr std::chrono::seconds kThreadLimit{1};      // For the threads of an old object to end.
constexpr std::chrono::milliseconds kThreadLook{5};  // How often to look whether they have.

/// How long to wait before the restart number `count`, from 1.
std::chrono::nanoseconds back_off(const config::RestartDescription& restart, std::uint32_t count) {
  std::chrono::nanoseconds delay = std::min(restart.back_off, restart.back_off_max);
  for (std::uint32_t i = 1; i < count && delay < restart.back_off_max; ++i) {
    delay = std::min(2 * delay, restart.back_off_max);
  }
  return delay;
}

}  // namespace

ComponentCore::ComponentCore(host::ComponentHost& its_application, std::uint32_t its_index,
                             config::ComponentDescription its_description,
                             const ComponentClass& its_class, const base::Clock& its_clock)
    : Actor(its_description.name, its_index, its_clock),
      application(its_application),
      description(std::move(its_description)),
      component_class(its_class),
      log_source(its_application.log_queue(), name, its_clock,
                 description.log_level.value_or(its_application.description().log_level)),
      param_table(its_application.param_mutex()) {}

ComponentCore::~ComponentCore() = default;

std::optional<std::string> ComponentCore::construct(config::Problems& its_problems) {
  problems = &its_problems;
  params = std::make_unique<config::ParamReader>(
      own_params(), application.description().shared_params, its_problems);
  if (param_table.begin()) {
    publishing.learned(ReadKind::kMadeWith, param_table.begun_with());
  }
  is_constructing = true;
  const std::size_t problems_before = its_problems.error_count();
  std::optional<std::string> thrown;
  try {
    const CallScope scope(*this, "its constructor");
    component = component_class.create(context);
    state = State::kConstructed;
  } catch (const std::exception& exception) {
    thrown = exception.what();
  } catch (...) {
    thrown = "something that is no std::exception";
  }
  is_constructing = false;
  declared_params = params->declared();
  if (!thrown) {
    params->finish();
    param_table.end();
    if (its_problems.error_count() == problems_before) {
      check_params(its_problems);
    }
    check_unused(its_problems);
    if (description.serve_period) {
      add_timer({.period = *description.serve_period, .phase = description.serve_phase},
                [this](const Tick&) { component->serve(); },
                {.name = "serve", .label = "its serve()"});
    }
    if (timer_labels.empty()) {
      std::ranges::transform(timers(), std::back_inserter(timer_labels),
                             [](const auto& timer) { return timer->role.label; });
    }
  }
  params.reset();
  problems = nullptr;
  return thrown;
}

void ComponentCore::check_params(config::Problems& its_problems) const {
  const std::lock_guard lock(application.param_mutex());
  for (const std::string& sentence : param_table.objections({})) {
    its_problems.add(config::make_error(description.params.place(),
                                        std::string("component \"") + name + "\": " + sentence));
  }
}

void ComponentCore::check_unused(config::Problems& its_problems) const {
  const std::vector<std::string> known(topics_in_code.begin(), topics_in_code.end());
  const auto check = [&](const std::string& topic, const config::Place& place, const char* where) {
    if (!topics_in_code.contains(topic)) {
      its_problems.add(config::make_error(place,
                                          std::string("component \"") + name +
                                              "\" names no topic \"" + topic + "\" (" + where + ")",
                                          config::did_you_mean(config::nearest(topic, known))));
    }
  };
  for (const auto& [topic, subscriber] : description.subscribers) {
    check(topic, subscriber.place, "subscribers");
  }
  for (const auto& [topic, publisher] : description.publishers) {
    check(topic, publisher.place, "publishers");
  }
  for (const auto& [topic, target] : description.remap) {
    check(topic, description.place, "remap");
  }
  std::vector<std::string> made;
  std::ranges::transform(threads, std::back_inserter(made), &NamedThread::name);
  for (const auto& [thread, options] : description.threads) {
    if (std::ranges::find(made, thread) == made.end()) {
      its_problems.add(config::make_error(
          options.place,
          std::string("component \"") + name + "\" makes no thread \"" + thread + "\"",
          config::did_you_mean(config::nearest(thread, made))));
    }
  }
}

std::string ComponentCore::declare_topic(std::string_view name_in_code) {
  const std::string full_name = topic_name(name_in_code);
  topics_in_code.emplace(name_in_code);
  if (full_name.find(kServiceMark) == std::string::npos) {
    return full_name;
  }
  const std::string what = "component \"" + name + "\" uses the name \"" + full_name +
                           "\": only topics of services have a '#' in theirs";
  if (problems == nullptr) {
    throw std::runtime_error(what);
  }
  problems->add(config::make_error(description.place, what));
  return full_name;
}

SubscriberOptions ComponentCore::subscriber_options(std::string_view topic,
                                                    SubscriberOptions options) const {
  const auto found = description.subscribers.find(std::string(topic));
  if (found == description.subscribers.end()) {
    return options;
  }
  if (found->second.depth) {
    options.depth = found->second.depth;
  }
  if (found->second.overflow) {
    options.overflow = *found->second.overflow == config::Overflow::kDropOldest
                           ? Overflow::kDropOldest
                           : Overflow::kDropNewest;
  }
  const config::SubscriberDescription& its = found->second;
  options.history = its.history ? its.history : options.history;
  options.deadline = its.deadline ? its.deadline : options.deadline;
  options.lifespan = its.lifespan ? its.lifespan : options.lifespan;
  options.liveliness = its.liveliness ? its.liveliness : options.liveliness;
  return options;
}

void ComponentCore::redeclare_subscription(CallbackSubscription& subscription,
                                           const SubscriberOptions& options,
                                           EnvelopeCallback its_callback) {
  subscription.callback = std::make_unique<EnvelopeCallback>(std::move(its_callback));
  subscription.set_history(options);
  if (subscription.quality != nullptr) {
    subscription.quality->set(options);
    watch(subscription);
  }
  application.wiring().reopen_subscription(*this, subscription);
}

void ComponentCore::offer(PublisherCore& publisher, Duration deadline,
                          const QosCallback& on_event) {
  auto found = std::ranges::find(offered, &publisher,
                                 [](const auto& watched) { return &watched->publisher; });
  if (found == offered.end()) {
    found = offered.insert(found, std::make_unique<OfferedDeadline>(publisher, deadline));
  }
  OfferedDeadline& watched = **found;
  watched.place = Watch::kOffered | static_cast<std::uint32_t>(found - offered.begin());
  watched.set_period(deadline);
  watched.set_callback(on_event);
  add_watch(watched);
}

void ComponentCore::destroy() {
  if (component == nullptr) {
    return;
  }
  std::string error;
  const CallScope scope(*this, "its destructor");
  if (!component_class.destroy(std::exchange(component, nullptr), error)) {
    note_fault("its destructor threw: " + error);
  }
}

void ComponentCore::call_start() {
  if (state != State::kConstructed) {
    return;
  }
  if (publishing.learn(ReadKind::kLateStart, 0, [this] { return first_start.is_late(); }) != 0) {
    throw std::runtime_error(first_start.why());
  }
  in_call_ = "its start()";
  first_start.set(Start::Stage::kCalled);
  component->start();
  in_call_ = nullptr;
  first_start.set(Start::Stage::kReturned);
  if (publishing.learn(ReadKind::kLateStart, 0, [this] { return first_start.is_late(); }) != 0) {
    throw std::runtime_error(first_start.why());
  }
  state = State::kStandby;
  if (is_wanted) {
    activate_now();
  } else {
    suspend();
    end_services(CallStatus::kAbsent, CallStatus::kCancelled, inactive());
    mute(true);
  }
}

void ComponentCore::begin_timers(Time start) {
  const std::uint64_t start_ns =
      publishing.learn(ReadKind::kBegan, 0, [start] { return base::to_ns(start); });
  timers_began = base::from_ns(static_cast<std::int64_t>(start_ns));
  if (state == State::kActive) {
    start_timers(*timers_began);
  }
}

std::string ComponentCore::late_start() const {
  const std::chrono::duration<double, std::milli> limit = description.start_timeout;
  return fmt::format("its start() takes longer than {} ms", limit.count());
}

std::string ComponentCore::inactive() const {
  return "component \"" + name + "\" is not active";
}

void ComponentCore::activate_now() {
  state = State::kActive;
  mute(false);
  in_call_ = "its activate()";
  {
    struct Resuming {
      ComponentCore& core;
      ~Resuming() { core.set_resuming(false); }
    };
    set_resuming(true);
    const Resuming end{*this};
    component->activate();
  }
  in_call_ = nullptr;
  if (is_suspended()) {
    resume();
  } else {
    open();
  }
}

void ComponentCore::call_activate() {
  is_wanted = true;
  if (state == State::kStandby) {
    activate_now();
    start_timers(publishing.now);
    application.wiring().report_liveliness(*this, true, "active");
    application.component_changed(*this, true);
  }
}

void ComponentCore::call_deactivate() {
  is_wanted = false;
  // In any case, nothing is delivered after this.
  struct End {
    ComponentCore& core;
    ~End() {
      core.cancel_timers();
      core.mute(true);
    }
  };
  const End end{*this};
  if (state == State::kActive) {
    state = State::kStandby;
    suspend();
    application.wiring().report_liveliness(*this, false, "inactive");
    application.component_changed(*this, true);
    end_services(CallStatus::kAbsent, CallStatus::kCancelled, inactive());
    in_call_ = "its deactivate()";
    component->deactivate();
    in_call_ = nullptr;
  }
}

void ComponentCore::call_stop() {
  if (!has_started()) {
    return;
  }
  const State before = state.exchange(State::kStopped);
  versions->interrupted("the application stops");
  was_active_at_end = before == State::kActive;
  cancel_alarm();
  if (is_suspended()) {
    drop_waiting();
  }
  application.wiring().report_liveliness(*this, false, "stopped");
  // Resources released by `stop` must not be used any more: no message and no tick is served after
  // it, not even one that it arms itself.
  close(DropReason::kShutdown);
  struct End {
    ComponentCore& core;
    ~End() { core.cancel_timers(); }
  };
  const End end{*this};
  end_services(CallStatus::kShutdown, CallStatus::kShutdown, "the application stops");
  if (before == State::kActive) {
    in_call_ = "its deactivate()";
    component->deactivate();
  }
  if (before != State::kRestarting || std::exchange(owes_stop_, false)) {
    in_call_ = "its stop()";
    component->stop();
  }
  in_call_ = nullptr;
  // Calls that it made meanwhile.
  end_services(CallStatus::kShutdown, CallStatus::kShutdown, "the application stops");
}

void ComponentCore::mute(bool is_muted) {
  publishing.is_muted = is_muted;
  for (PublisherCore* publisher : declared.publishers) {
    if (publisher->options.is_external) {
      const std::lock_guard lock(publisher->mutex());
      publisher->set_external_muted(is_muted);
    }
  }
}

void ComponentCore::take_params(std::uint64_t transaction, const host::ParamValues& values,
                                const std::string& text) {
  publishing.learned(ReadKind::kParams, text);
  if (states != nullptr) {
    states->change_params(transaction, text);
  }
  // One that waits for its reconstruction will begin with them.
  const bool is_there = state == State::kStandby || state == State::kActive;
  if (is_there || state == State::kConstructed) {
    param_table.take_over(transaction, values, is_there);
  }
}

void ComponentCore::note_fault(std::string_view what) {
  note_contained_fault(what);
  if (description.on_fault == config::OnFault::kStop) {
    application.end_by_fault();
  }
}

void ComponentCore::note_contained_fault(std::string_view what) {
  ++fault_count;
  if (state != State::kFailed) {
    last_fault = what;  // The first fault is kept, regardless of later faults of offloaded work.
  }
  if (faults.size() < kFaultsInWords) {
    faults.emplace_back(what);
  }
  log_source.write(LogLevel::kError, what);
  if (publishing.is_following) {
    return;  // The followed instance handles the consequences.
  }
  application.fault_noted(*this, what);
}

void ComponentCore::fail(std::string_view what) {
  note_fault(what);
  versions->interrupted(std::string(what));
  end_calls(what);
  state = State::kFailed;
  cancel_alarm();
  open();  // Later messages are removed and counted, not left waiting.
  cancel_timers();
  close(DropReason::kFault);
  application.component_failed(*this);
  application.wiring().report_liveliness(*this, false, "failed");
  application.component_changed(*this, true);
  if (!description.fault_mode.empty()) {
    application.ask_mode(description.fault_mode, what, *this);
  }
}

void ComponentCore::post_fault(std::uint64_t object, const std::string& what) {
  post(
      Cause::kFault,
      [this, object, what] {
        publishing.learned(ReadKind::kThrew, what);
        take_fault_of_thread(object, what);
      },
      nullptr, fault_key_of_thread(object));
}

void ComponentCore::take_fault_of_thread(std::uint64_t object, const std::string& what) {
  if (object != kAnyObject && restart_count != object) {
    note_fault(what);
    return;
  }
  throw std::runtime_error(what);
}

void ComponentCore::on_qos_event(const Watch&, const QosEvent& event) {
  if (event.kind == QosKind::kDeadlineMissed) {
    application.deadline_missed(event);
  }
}

void ComponentCore::on_breach(std::size_t chain) {
  application.chain_breached(*this, chain);
}

void ComponentCore::on_fault(std::string_view thrown) {
  std::string what(thrown);
  if (const char* call = in_call_.exchange(nullptr)) {
    what = std::string(call) + " threw: " + what;
  }
  versions->interrupted(what);
  if (state == State::kStopped || state == State::kFailed || state == State::kRestarting) {
    note_fault(what);
    application.component_changed(*this, true);
  } else if (versions->take_fault(what)) {
    return;
  } else if (description.on_fault == config::OnFault::kRestart && has_started()) {
    restart(what);
  } else {
    fail(what);
  }
}

void ComponentCore::end_calls(std::string_view what) {
  serving = {};
  if (!publishing.is_in_activation()) {
    return;  // It never ran.
  }
  for (const auto& client : clients) {
    client->abandon(what);
    client->is_declared = false;
  }
  for (const auto& server : servers) {
    server->abandon(what);
    server->is_declared = false;
  }
}

void ComponentCore::end_services(CallStatus owed, CallStatus awaited, std::string_view reason) {
  for (const auto& server : servers) {
    server->end_all(owed, reason);
  }
  const char* before = in_call_.exchange("its callback for a reply");
  for (const auto& client : clients) {
    client->end_all(awaited, reason);
  }
  in_call_ = before;
}

void ComponentCore::end_late_subscriptions() {
  for (CallbackSubscription* subscription : subscriptions.callbacks()) {
    if (std::find(declared.subscriptions.begin(), declared.subscriptions.end(), subscription) ==
            declared.subscriptions.end() &&
        !subscription->outlives_faults) {
      application.wiring().end_subscription(*this, *subscription, DropReason::kUnsubscribed);
    }
  }
}

void ComponentCore::end_old_subscriptions() {
  end_late_subscriptions();
  // The new object receives the messages of latched topics again.
  for (CallbackSubscription* subscription : declared.subscriptions) {
    if (subscription->kind == Subscription::Kind::kCallback &&
        subscription->topic.options.latched > 0 && !subscription->is_ended) {
      application.wiring().end_subscription(*this, *subscription, DropReason::kFault);
    }
  }
}

bool ComponentCore::is_redeclared() const noexcept {
  const auto is_declared = [](const auto& service) { return service->is_declared; };
  return std::ranges::all_of(clients, is_declared) && std::ranges::all_of(servers, is_declared) &&
         redeclared.publishers.size() == declared.publishers.size() &&
         redeclared.subscriptions.size() == declared.subscriptions.size() &&
         redeclared.views.size() == declared.views.size() &&
         redeclared.synchronizers.size() == declared.synchronizers.size();
}

void ComponentCore::escalate(std::string_view what) {
  using config::AfterRestarts;
  const config::RestartDescription& limits = description.restart;
  const bool ends_process =
      limits.then == AfterRestarts::kProcess && application.may_end_process(*this);
  const char* const then = ends_process                          ? "its process is restarted"
                           : limits.then == AfterRestarts::kStop ? "the application stops"
                                                                 : "it stays stopped";
  const std::string text =
      std::string(what) + fmt::format(" (restarted {} times within {} s: {})", restarts,
                                      std::chrono::duration<double>(limits.within).count(), then);
  if (ends_process) {
    note_fault(text);
    application.end_process(*this, text);
    return;
  }
  fail(text);
  if (limits.then == AfterRestarts::kStop) {
    application.end_by_fault();
  }
}

void ComponentCore::restart(std::string_view what) {
  const config::RestartDescription& limits = description.restart;
  const std::int64_t now_ns = base::to_ns(publishing.now);
  if (restarts == 0 || now_ns - first_restart_ns > limits.within.count()) {
    restarts = 0;
    first_restart_ns = now_ns;
  }
  if (restarts >= limits.limit) {
    escalate(what);
    return;
  }
  ++restarts;
  const std::chrono::nanoseconds delay = back_off(limits, restarts);
  if (delay.count() == 0) {
    note_fault(std::string(what) + " (restarting)");
  } else {
    note_fault(std::string(what) +
               fmt::format(" (restarting in {} ms)",
                           std::chrono::duration<double, std::milli>(delay).count()));
  }
  application.wiring().report_liveliness(*this, false, "failed");
  end_calls(what);
  end_threads([this, delay] { replace(delay); });
}

void ComponentCore::end_threads(const std::function<void()>& next) {
  in_call_ = "a stop_callback of its threads";
  application.threads().ask_threads_to_end(*this);
  in_call_ = nullptr;
  await_threads(base::monotonic_ns() + std::chrono::nanoseconds(kThreadLimit).count(), next);
}

void ComponentCore::await_threads(std::int64_t deadline_ns, const std::function<void()>& next) {
  host::ThreadHost& its_threads = application.threads();
  application.time().await(deadline_ns, [&] { return its_threads.running_threads(*this).empty(); });
  const std::vector<std::string> late = its_threads.running_threads(*this);
  enum : std::uint8_t { kEnded, kAwaited, kTooLate };
  const std::uint64_t how = publishing.learn(ReadKind::kThreads, 0, [&] {
    return late.empty() ? kEnded : base::monotonic_ns() < deadline_ns ? kAwaited : kTooLate;
  });
  if (how == kEnded) {
    its_threads.join_threads(*this);
    next();
    return;
  }
  if (how == kTooLate) {
    // Its object cannot go while a thread uses it.
    fail(fmt::format(
        "its thread \"{}\" has not ended within {} s after its stop_token asked for it: "
        "it stays stopped",
        late.empty() ? "?" : late.front(), kThreadLimit.count()));
    return;
  }
  if (state != State::kRestarting) {
    state = State::kRestarting;
    application.component_changed(*this, true);
    if (keeps_messages_) {
      suspend_keeping();
    } else {
      suspend();
    }
  }
  set_alarm(publishing.now + kThreadLook,
            [this, deadline_ns, next] { await_threads(deadline_ns, next); });
}

void ComponentCore::begin_anew() {
  destroy();
  clear_timers();
  make_anew();
}

void ComponentCore::end_object() {
  ++restart_count;
  destroy();
  end_old_subscriptions();
  clear_timers();
}

void ComponentCore::replace(std::chrono::nanoseconds delay) {
  keeps_messages_ = false;
  if (states != nullptr) {
    states->end_object();
  }
  end_object();
  drop_held(DropReason::kFault);
  forget_held();
  if (delay.count() == 0) {
    make_anew();
    return;
  }
  state = State::kRestarting;
  application.component_changed(*this, true);
  suspend();
  set_alarm(publishing.now + delay, [this] { make_anew(); });
}

std::string ComponentCore::renew() {
  const State before = state;
  if (before != State::kActive && before != State::kStandby) {
    return std::string("it is ") + host::to_word(before);
  }
  if (before == State::kActive) {
    in_call_ = "its deactivate()";
    component->deactivate();
    in_call_ = nullptr;
  }
  // Its threads must not use resources released by `stop`.
  owes_stop_ = true;
  end_threads([this] {
    owes_stop_ = false;
    state = State::kStandby;
    in_call_ = "its stop()";
    component->stop();
    in_call_ = nullptr;
    application.wiring().report_liveliness(*this, false, "restarted");
    end_calls("it is made anew");
    replace(std::chrono::nanoseconds(0));
  });
  return {};
}

std::string ComponentCore::obey(LifeStep step) {
  const State before = state;
  if (step == LifeStep::kRenew) {
    return renew();
  }
  if (step == LifeStep::kRollBack) {
    return versions->roll_back("a tool asked for it");
  }
  if (step == LifeStep::kConfirm) {
    return versions->confirm("a tool asked for it");
  }
  if (step == LifeStep::kToolStop && before == State::kActive) {
    call_deactivate();
  } else if (step == LifeStep::kToolStart && before == State::kStandby) {
    call_activate();
  } else {
    return std::string("it is ") + host::to_word(before);
  }
  return {};
}

void ComponentCore::make_anew() {
  const std::string why_not = try_anew();
  if (why_not.empty()) {
    return;
  }
  // What it needs may not be back yet: this counts as one more fault.
  if (description.on_fault == config::OnFault::kRestart) {
    restart(why_not);
  } else {
    fail(why_not);
  }
}

std::string ComponentCore::try_anew() {
  redeclared = {};
  threads.clear();
  is_redeclaring = true;
  // Of the same class they were found right before; of another one, by its trial.
  config::Problems ignored;
  const auto thrown = construct(ignored);
  is_redeclaring = false;
  if (thrown) {
    return "its constructor threw when it was restarted: " + *thrown;
  }
  if (!is_redeclared()) {
    return "it declared fewer topics or services than before when it was restarted";
  }
  std::string what = "something that is no std::exception";
  try {
    call_start();
    keeps_messages_ = false;
    application.threads().start_threads(*this);
    if (state == State::kActive) {
      start_timers(publishing.now);
      application.wiring().report_liveliness(*this, true, "restarted");
    }
    versions->watch();
    application.component_changed(*this, true);
    return {};
  } catch (const std::exception& exception) {
    what = exception.what();
  } catch (...) {  // `what` describes it already.
  }
  const char* call = in_call_.exchange(nullptr);
  return std::string(call == nullptr ? "it" : call) + " threw when it was restarted: " + what;
}

}  // namespace fastcycle::detail

#include "component/lifecycle.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "component/peers.h"
#include "component/policy.h"
#include "component/service_topics.h"
#include "component/steps.h"
#include "component/wait.h"
#include "executor/activation_ring.h"

namespace fastcycle::host {

using detail::ActivationRecord;
using detail::Cause;
using detail::ComponentCore;
using detail::LifeStep;

namespace {

/// Text for the callback that received the message of `publisher`.
std::string callback_for(const Wiring& wiring, PublisherId publisher) {
  std::string name = "a message";
  wiring.look([&](const detail::Topics& topics) {
    for (const auto& [topic_name, topic] : topics.all()) {
      for (const auto& one : topic->publishers) {
        if (one->id == publisher) {
          name = "\"" + topic_name.substr(0, topic_name.find(detail::kServiceMark)) + "\"";
        }
      }
    }
  });
  return "its callback for " + name;
}

}  // namespace

// ---- The start ----

bool Lifecycle::start(std::int64_t deadline_ns) {
  const auto& components = host_.components();
  Peers* const peers = host_.peers();
  const std::size_t places = peers != nullptr ? peers->place_count() : order_.size();
  for (std::size_t place = 0; place < places; ++place) {
    if (host_.is_to_end()) {
      return false;
    }
    time_.begin_part(part_++);
    if (place >= order_.size()) {
      time_.follow_call();
      continue;
    }
    ComponentCore& component = *components[order_[place]];
    if (peers != nullptr) {
      peers->reach_start(place);
      if (!peers->runs_here(component.name)) {
        peers->await_start(component, place, [this] { return host_.is_to_end(); });
        time_.follow_call();
        continue;
      }
    }
    start_component(component, deadline_ns);
  }
  time_.begin_run(static_cast<std::uint32_t>(places));
  return true;
}

void Lifecycle::start_component(ComponentCore& component, std::int64_t deadline_ns) {
  using Stage = ComponentCore::Start::Stage;
  if (component.state != ComponentCore::State::kConstructed) {
    time_.follow_call();
    return;
  }
  ComponentCore::Start& its = component.first_start;
  its.bell = &bell_;
  const ControlCall call =
      time_.call(component, LifeStep::kStart, [&component] { component.call_start(); });
  const std::chrono::nanoseconds limit = component.description.start_timeout;
  const std::chrono::nanoseconds begin_limit = limit + kStepLimit;  // Where others hold its worker.
  const auto wait_while = [&](Stage stage, std::chrono::nanoseconds its_limit) {
    return bell_.wait(limit.count() == 0 ? deadline_ns : deadline_in(its_limit, deadline_ns),
                      [&] { return call.is_over() || host_.is_to_end() || its.stage() != stage; });
  };
  const bool is_begun = wait_while(Stage::kWaiting, begin_limit);
  const bool is_in_time = is_begun && wait_while(Stage::kCalled, limit);
  if (call.is_over() || host_.is_to_end()) {
    return;
  }
  const bool is_the_last = base::monotonic_ns() >= deadline_ns;
  const std::string what =
      is_the_last ? "its start() has not returned while the application may start"
      : is_begun  ? component.late_start()
                  : fmt::format("its start() could not begin within {} ms: its executor is busy",
                                std::chrono::duration<double, std::milli>(begin_limit).count());
  if (is_in_time || !its.expire(what)) {
    // It has returned: its worker only puts an end to the activation.
    bell_.wait(deadline_ns, [&] { return call.is_over() || host_.is_to_end(); });
    return;
  }
  // It becomes a fault of the component as soon as its worker is back; the others do not wait.
  host_.log(LogLevel::kError, component.name, what);
  if (is_the_last || component.description.on_fault == config::OnFault::kStop) {
    host_.end_by_fault();
  }
}

void Lifecycle::start_timers(Time start) {
  for (const auto& component : host_.components()) {
    component->post(
        Cause::kMode, [&component, start] { component->begin_timers(start); }, nullptr,
        detail::to_key(LifeStep::kBeginTimers));
  }
}

/// Options of a component's own thread. In simulated time, in which nothing waits for it, the
/// defaults.
base::ThreadOptions Lifecycle::options_of(const config::ComponentDescription& component,
                                          const std::string& thread) const {
  base::ThreadOptions options{.name = thread, .cpus = {}};
  const auto described = component.threads.find(thread);
  if (!time_.is_simulated() && described != component.threads.end()) {
    options.cpus = described->second.cpus;
    options.policy = to_policy(described->second.policy);
    options.priority = described->second.priority;
    options.slice_us = described->second.slice_us;
  }
  return options;
}

void Lifecycle::start_threads(std::vector<base::Refusal>& refusals) {
  const std::lock_guard lock(threads_mutex_);
  threads_stage_ = ThreadsStage::kRun;
  for (const auto& component : host_.components()) {
    // One that is being reconstructed starts them itself.
    if (component->has_started() && !between_objects_.contains(component.get())) {
      begin_threads(*component, refusals);
    }
  }
}

void Lifecycle::start_threads(ComponentCore& component) {
  std::vector<base::Refusal> refusals;  // The same that were reported at its first start.
  const std::lock_guard lock(threads_mutex_);
  between_objects_.erase(&component);
  if (threads_stage_ == ThreadsStage::kRun) {
    begin_threads(component, refusals);
  }
}

void Lifecycle::begin_threads(ComponentCore& component, std::vector<base::Refusal>& refusals) {
  for (const ComponentCore::NamedThread& thread : component.threads) {
    threads_.push_back(std::make_unique<OwnThread>(component, thread, component.restart_count));
    OwnThread& its = *threads_.back();
    time_.foreign_thread_begins();
    try {
      its.thread = base::Thread(
          options_of(component.description, thread.name), [this, &its] { run_thread(its); },
          refusals);
    } catch (...) {
      end_thread(its);
      throw;
    }
  }
}

void Lifecycle::run_thread(OwnThread& its) {
  // Last of all: until then a simulation, the end of the run, and a restart wait for what comes
  // from here.
  const auto end = [this](OwnThread* ending) { end_thread(*ending); };
  const std::unique_ptr<OwnThread, decltype(end)> guard(&its, end);
  const detail::ServingThread serving;
  std::string what;
  try {
    const detail::CallScope scope(its.component, "its thread", its.named.name.c_str(), false);
    its.named.body(its.stop.get_token());
    return;
  } catch (const std::exception& exception) {
    what = exception.what();
  } catch (...) {
    what = "something that is no std::exception";
  }
  its.component.post_fault(its.object, "its thread \"" + its.named.name + "\" threw: " + what);
}

void Lifecycle::end_thread(OwnThread& its) noexcept {
  time_.foreign_thread_ends();
  its.has_ended.store(true);
}

std::vector<std::stop_source> Lifecycle::stop_sources(const ComponentCore* component) const {
  std::vector<std::stop_source> sources;
  const std::lock_guard lock(threads_mutex_);
  for (const auto& its : threads_) {
    if (component == nullptr || &its->component == component) {
      sources.push_back(its->stop);
    }
  }
  return sources;
}

void Lifecycle::ask_threads_to_end(ComponentCore& component) {
  {
    const std::lock_guard lock(threads_mutex_);
    between_objects_.insert(&component);
  }
  for (std::stop_source& stop : stop_sources(&component)) {
    stop.request_stop();
  }
}

std::vector<std::string> Lifecycle::running_threads(const ComponentCore& component) const {
  std::vector<std::string> names;
  const std::lock_guard lock(threads_mutex_);
  for (const auto& its : threads_) {
    if (&its->component == &component && !its->has_ended) {
      names.push_back(its->named.name);
    }
  }
  return names;
}

bool Lifecycle::have_threads_ended() const {
  const std::lock_guard lock(threads_mutex_);
  return std::ranges::all_of(threads_, [](const auto& its) { return its->has_ended.load(); });
}

template <typename Which>
void Lifecycle::join(const Which& which) {
  std::vector<std::unique_ptr<OwnThread>> joined;
  {
    const std::lock_guard lock(threads_mutex_);
    for (auto& its : threads_) {
      if (which(*its)) {
        joined.push_back(std::move(its));
      }
    }
    std::erase(threads_, nullptr);
  }
  for (const auto& its : joined) {
    its->thread.join();
  }
}

void Lifecycle::join_threads(const ComponentCore& component) {
  join([&](const OwnThread& its) { return &its.component == &component; });
}

// ---- The end ----

/// Of one step; with the first one the time for all of them begins.
std::int64_t Lifecycle::step_deadline() {
  const std::chrono::nanoseconds limit = step_limit();
  if (end_ns_ == base::kNever) {
    end_ns_ = deadline_in(kEndLimit - kStepLimit + limit);
  }
  return deadline_in(limit, end_ns_);
}

/// A callback that may take long is waited for as long.
std::chrono::nanoseconds Lifecycle::step_limit() const {
  std::chrono::nanoseconds limit = kStepLimit;
  for (const auto& component : host_.components()) {
    limit = std::max(limit, component->description.hang.callback_limit);
  }
  return limit;
}

void Lifecycle::stop_threads() {
  const std::int64_t deadline_ns = step_deadline();
  {
    const std::lock_guard lock(threads_mutex_);
    threads_stage_ = ThreadsStage::kEnd;
  }
  for (std::stop_source& stop : stop_sources(nullptr)) {
    stop.request_stop();
  }
  // One that waits for its device ends when `stop` of its component closes that.
  wait_until(deadline_ns, [this] { return have_threads_ended(); });
}

void Lifecycle::stop_timers() {
  part_ = kStopPart;
  const Peers* const peers = host_.peers();
  const std::size_t places = peers != nullptr ? peers->place_count() : order_.size();
  for (std::size_t place = 0; place < places; ++place) {
    time_.begin_part(part_++);
    if (place >= order_.size()) {
      time_.follow_call();
      continue;
    }
    ComponentCore& core = *host_.components()[order_[place]];
    asked_.push_back({core, time_.call(core, LifeStep::kEndTimers, [&core] {
                        core.cancel_timers();
                        core.cancel_alarm();
                      })});
  }
  bell_.wait(step_deadline(), [this] {
    return std::ranges::all_of(asked_, [](const Asked& one) { return one.call.is_over(); });
  });
  time_.begin_part(part_++);
}

void Lifecycle::drain() {
  time_.drain(step_deadline());
}

bool Lifecycle::is_pending(const ComponentCore& component) const {
  return std::ranges::any_of(asked_, [&](const Asked& one) {
    return &one.component == &component && !one.call.is_over();
  });
}

void Lifecycle::stop_components() {
  Peers* const peers = host_.peers();
  const auto follow = [this] {
    time_.follow_call();  // Of `stop`,
    time_.follow_call();  // and of the end of its subscriptions.
  };
  for (std::size_t place = peers != nullptr ? peers->place_count() : order_.size(); place-- > 0;) {
    time_.begin_part(part_++);
    if (place >= order_.size()) {
      follow();
      continue;
    }
    ComponentCore& core = *host_.components()[order_[place]];
    if (peers != nullptr) {
      peers->reach_stop(place);
      if (!peers->runs_here(core.name)) {
        peers->await_stop(core, place);
        follow();
        continue;
      }
    }
    const bool is_held_up = is_pending(core);
    asked_.push_back({core, time_.call(core, LifeStep::kStop, [&core] { core.call_stop(); })});
    asked_.push_back({core, time_.call(core, LifeStep::kClose,
                                       [&core] { core.close(detail::DropReason::kShutdown); })});
    if (!is_held_up && !bell_.wait(step_deadline(), [&] { return !is_pending(core); })) {
      host_.log(LogLevel::kWarning, core.name,
                "its stop() takes longer than 1 s: the others stop meanwhile");
    }
  }
}

void Lifecycle::finish() {
  time_.refuse_jobs();
  static_cast<void>(step_deadline());
  wait_until(end_ns_, [this] {
    return std::ranges::all_of(asked_, [](const Asked& one) { return one.call.is_over(); }) &&
           have_threads_ended() && std::ranges::none_of(host_.components(), [](const auto& core) {
             return core->jobs.load() > 0;
           });
  });
  join([](const OwnThread& its) { return its.has_ended.load(); });
  time_.drain(step_deadline());
  find_stuck();
}

void Lifecycle::find_stuck() {
  const auto add = [this](ComponentCore& core, std::string call) {
    stuck_.push_back({core.name, std::move(call)});
    core.is_stuck = true;
  };
  for (const auto& core : host_.components()) {
    core->is_left_alone = is_stuck(*core);
    if (std::string call = is_pending(*core) ? call_of(*core) : ""; !call.empty()) {
      add(*core, std::move(call));
    }
    if (core->jobs > 0) {
      add(*core, "work that it offloaded");
    }
    for (const std::string& thread : running_threads(*core)) {
      add(*core, "its thread \"" + thread + "\"");
    }
  }
  if (!stuck_.empty()) {
    return;  // Others that wait for a worker which one of these holds are not to blame.
  }
  for (const auto& core : host_.components()) {
    if (is_pending(*core)) {
      add(*core, "its stop(), to which its executor has not come");
    }
  }
}

/// Its running callback; empty if there is none.
std::string Lifecycle::call_of(const ComponentCore& component) const {
  std::optional<ActivationRecord> running;
  for (const detail::ActivationRing* ring : time_.rings()) {
    for (const ActivationRecord& record : ring->snapshot()) {
      if (record.component == component.index && record.outcome == detail::Outcome::kRunning &&
          (!running || running->number < record.number)) {
        running = record;
      }
    }
  }
  if (!running) {
    return {};
  }
  if (const char* call = component.call_in_words()) {
    return call;
  }
  switch (running->cause) {
    case Cause::kMessage:
    case Cause::kExternal:
    case Cause::kRequest:
    case Cause::kReply:
      return callback_for(wiring_, running->publisher);
    case Cause::kTick:
      return running->key < component.timer_labels.size() ? component.timer_labels[running->key]
                                                          : "a timer";
    case Cause::kJob:
      return "its callback after offloaded work";
    case Cause::kParameter:
      return "its callback for changed params";
    case Cause::kEvent:
      return "its callback for an event";
    case Cause::kTimeout:
      return "its callback for a call that took too long";
    case Cause::kMode:
    case Cause::kConnect:
    case Cause::kFault:
      break;
  }
  return "a call of its life cycle";
}

bool Lifecycle::is_stuck(const detail::Actor& component) const {
  const auto& core = static_cast<const ComponentCore&>(component);
  return is_pending(core) || core.jobs > 0 || !running_threads(core).empty();
}

void Lifecycle::join_threads() {
  join([](const OwnThread&) { return true; });
}

}  // namespace fastcycle::host

// The functions of `Context`, which call the application.

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "broker/activation_check.h"
#include "component/component_core.h"
#include "component/component_host.h"
#include "component/declare.h"
#include "component/declared_states.h"
#include "component/time_driver.h"
#include "config/nearest.h"
#include "config/params.h"
#include "fastcycle/param_list.h"
#include "params/param_info.h"

namespace fastcycle {

namespace detail {
namespace {

/// Whether `component` may use what it made: in its activations, its constructor, its destructor.
bool may_use_its_own(const ActorBase& component) noexcept {
  return is_in_activation_of(component.publishing) ||
         static_cast<const ComponentCore&>(component).component == nullptr;
}

void assert_in_activation(const ComponentCore& core, const char* call, std::string_view name,
                          const char* remedy) {
  if (!is_in_activation_of(core.publishing)) [[unlikely]] {
    called_outside(core.publishing, call, name, remedy);
  }
}

/// For timers: ends the process if `call` is made outside of the component's callbacks.
void check_timer(const TimerCore& timer, const char* call) noexcept {
  if (!may_use_its_own(timer.actor)) [[unlikely]] {
    called_outside(
        timer.actor.publishing, call,
        timer.role.name.empty() ? fmt::format("timer {}", timer.number) : timer.role.name,
        "a component uses its timers in its own callbacks only");
  }
}

/// The same for a call that a timer with a period, or one without, does not have.
void check_period(const TimerCore& timer, bool is_periodic, const char* what,
                  const char* remedy) noexcept {
  if (timer.is_periodic() != is_periodic) [[unlikely]] {
    broke_contract(timer.actor.publishing, fmt::format("timer {} {}", timer.number, what), remedy);
  }
}

/// Checks that a pool has messages left to lend, besides those kept according to the file.
void check_pool(const PublisherCore& publisher, const config::PublisherDescription& configured,
                config::Problems& problems) {
  const PublisherCore::Options& options = publisher.options;
  const std::size_t held = options.keep + options.latched;
  if (configured.keep && options.pool_max > 0 && held >= options.pool_max) {
    problems.add(config::make_error(
        configured.place,
        fmt::format("the pool of \"{}\" has at most {} messages (\"pool_max\" of the topic), and "
                    "{} are kept or latched: none is left to lend",
                    publisher.topic.name, options.pool_max, held),
        fmt::format("say a \"keep\" of less than {}, or a larger \"pool_max\"",
                    options.pool_max - std::min(options.pool_max, options.latched))));
  }
}

}  // namespace

ParamSlot& declare_param(ComponentCore& core, std::unique_ptr<ParamSlot> slot) {
  assert_constructing(core, "param()", slot->spec.name);
  const std::string& name = slot->spec.name;
  const bool is_shared = core.own_params().find_dotted(name) == nullptr;
  const config::Value* ordered = core.versions->ordered_params();
  const bool is_ordered = ordered != nullptr && ordered->find_dotted(name) != nullptr;
  const config::Value* value =
      slot->spec.fallback ? core.params->find(name) : core.params->require(name);
  return core.param_table.declare(
      std::move(slot), value, {.is_shared = is_shared, .is_ordered = is_ordered}, *core.problems);
}

void set_on_change(ComponentCore& core, const ParamSlot& slot, std::function<void()> callback) {
  assert_constructing(core, "on_change() of", slot.spec.name);
  ParamSlot* its_slot = core.param_table.find(slot);
  if (its_slot == nullptr) {
    broke_contract(
        core.publishing,
        fmt::format("on_change() for the param \"{}\" of another component", slot.spec.name),
        "a component waits for changes of its own params");
  }
  if (!slot.spec.is_tunable) {
    core.problems->add(config::make_error(
        core.description.place, "component \"" + core.name + "\" waits for changes of its param " +
                                    config::in_quotes(slot.spec.name) +
                                    ", which is not declared as tunable"));
  }
  its_slot->on_change = std::move(callback);
}

PublisherCore& create_publisher(ComponentCore& core, std::string_view topic,
                                const google::protobuf::Message& default_instance,
                                const google::protobuf::Message* prototype, bool is_external) {
  assert_constructing(
      core, is_external ? "create_external_publisher() for" : "create_publisher() for", topic);
  const auto configured = core.description.publishers.find(std::string(topic));
  const bool is_configured = configured != core.description.publishers.end();
  PublisherCore& publisher =
      declare_publisher(core, core.declare_topic(topic), default_instance, prototype, is_external,
                        is_configured ? configured->second.keep : std::nullopt);
  if (is_configured && !core.is_redeclaring) {
    check_pool(publisher, configured->second, *core.problems);
  }
  return publisher;
}

google::protobuf::Message& declare_state(ComponentCore& core, std::string_view name,
                                         const google::protobuf::Message& default_instance,
                                         std::function<void(google::protobuf::Message&)> save) {
  assert_constructing(core, "state() of", name);
  if (core.states == nullptr) {
    core.states = std::make_unique<DeclaredStates>(core);
  }
  return static_cast<DeclaredStates&>(*core.states)
      .declare(name, default_instance, std::move(save));
}

void watch_publisher(ComponentCore& core, PublisherCore& publisher, std::string_view topic,
                     std::optional<Duration> deadline, const QosCallback& on_event) {
  const auto configured = core.description.publishers.find(std::string(topic));
  if (configured != core.description.publishers.end() && configured->second.deadline) {
    deadline = configured->second.deadline;
  }
  if (deadline) {
    core.offer(publisher, *deadline, on_event);
  }
}

Subscription& create_subscription(ComponentCore& core, std::string_view topic,
                                  const google::protobuf::Message& default_instance,
                                  const SubscriberOptions& options, EnvelopeCallback callback) {
  const std::string name = core.declare_topic(topic);
  if (core.is_constructing) {
    return declare_subscription(core, name, default_instance,
                                core.subscriber_options(topic, options), std::move(callback));
  }
  assert_in_activation(core, "create_subscriber() for", topic,
                       "subscribe in the constructor or in a callback");
  const std::string call = "subscribe " + name;
  if (const auto why = core.publishing.replayed_refusal(call)) {
    throw std::runtime_error(*why);
  }
  try {
    return core.application.wiring().subscribe_late(
        core, name, default_instance, core.subscriber_options(topic, options), std::move(callback));
  } catch (const std::runtime_error& refusal) {  // Others subscribe it as another type.
    core.publishing.refused(call, refusal.what());
    throw;
  }
}

void end_subscription(Subscription& subscription) noexcept {
  auto& callback = static_cast<CallbackSubscription&>(subscription);
  auto& core = static_cast<ComponentCore&>(callback.actor);
  core.application.wiring().end_subscription(core, callback, DropReason::kUnsubscribed);
}

View& create_view(ComponentCore& core, std::string_view topic,
                  const google::protobuf::Message& default_instance, std::size_t depth,
                  std::optional<Duration> span) {
  assert_constructing(core, "a view of", topic);
  const std::string name = core.declare_topic(topic);
  if (core.is_redeclaring) {
    return redeclare(core.declared.views, core.redeclared.views, name, default_instance);
  }
  Topic& its_topic = core.application.wiring().topics().get(name, core.name, default_instance);
  const auto kind =
      depth == 1 && !span ? Subscription::Kind::kLatest : Subscription::Kind::kHistory;
  auto view = std::make_unique<View>(its_topic, core, kind, depth, span,
                                     core.subscriber_options(topic, {}).lifespan);
  View& result = *view;
  its_topic.add(std::move(view));
  core.subscriptions.add(result);
  core.declared.views.push_back(&result);
  core.publishing.has_subscribers = true;
  return result;
}

std::size_t view_size(const View& view) noexcept {
  if (!may_use_its_own(view.actor)) [[unlikely]] {
    broke_contract(view.actor.publishing,
                   fmt::format("its view of \"{}\" is read outside of a callback", view.topic.name),
                   "hand what your own thread needs to it from a callback");
  }
  return view.held.size();
}
Envelope& view_at(const View& view, std::size_t index) noexcept {
  return *view.held[index];
}
Time view_now(const View& view) noexcept {
  return view.actor.publishing.now;
}
Holder view_holder(const View& view) noexcept {
  return view.holder;
}
Holder holder_of(const Subscription& subscription) noexcept {
  return subscription.holder;
}

TimerCore& create_timer(ComponentCore& core, const TimerOptions& options, TickCallback callback) {
  assert_constructing(core, "create_timer()");
  return core.add_timer(options, std::move(callback));
}

void arm_timer(TimerCore& timer, Time due) noexcept {
  check_timer(timer, "Timer::arm_at() of");
  check_period(timer, false, "is armed, but has a period, and arms itself",
               "use Timer::reset(), or create_timer(callback) for one without a period");
  timer.actor.arm(timer, due);
}

void arm_timer_in(TimerCore& timer, Duration delay) noexcept {
  check_timer(timer, "Timer::arm_in() of");
  check_period(timer, false, "is armed, but has a period, and arms itself",
               "use Timer::reset(), or create_timer(callback) for one without a period");
  timer.actor.arm(timer, timer.actor.publishing.now + delay);
}

void reset_timer(TimerCore& timer) noexcept {
  check_timer(timer, "Timer::reset() of");
  check_period(timer, true, "is reset, but has no period",
               "use Timer::arm_in(), or create_timer({.period = …}, callback)");
  timer.actor.arm(timer, timer.actor.publishing.now + timer.options.period);
}

namespace {

constexpr char kGave = '\0';
constexpr char kThrew = '\1';

void keep(ComponentCore& core, std::string_view name, char how, std::string_view what) {
  if (core.publishing.reads != nullptr && is_in_activation_of(core.publishing)) {
    std::string text(name);
    text += how;
    text += what;
    core.publishing.learned(ReadKind::kObserved, text);
  }
}

}  // namespace

std::optional<std::string> take_observed(ComponentCore& core, std::string_view name) {
  // A thread of its own or offloaded work may observe what it likes: it is an input.
  if (core.is_constructing && !is_in_activation_of(core.publishing)) [[unlikely]] {
    broke_contract(core.publishing, fmt::format("observe() of \"{}\" in the constructor", name),
                   "observe in start(), which a recorded run has, and its constructor it has not");
  }
  if (core.publishing.replayed == nullptr || !is_in_activation_of(core.publishing)) {
    return std::nullopt;
  }
  const ReplayedReads::Entry* entry = core.publishing.replayed->take(ReadKind::kObserved);
  if (entry == nullptr || entry->text.size() <= name.size() || !entry->text.starts_with(name)) {
    return std::nullopt;
  }
  std::string what = entry->text.substr(name.size() + 1);
  if (entry->text[name.size()] == kThrew) {
    throw std::runtime_error(what);
  }
  return what;
}

void keep_observed(ComponentCore& core, std::string_view name, std::string_view bytes) {
  keep(core, name, kGave, bytes);
}

void keep_failed_observation(ComponentCore& core, std::string_view name) {
  try {
    throw;
  } catch (const std::exception& exception) {
    keep(core, name, kThrew, exception.what());
  } catch (...) {
    keep(core, name, kThrew, "something that is no std::exception");
  }
}

void cancel_timer(TimerCore& timer) noexcept {
  check_timer(timer, "Timer::cancel() of");
  timer.due_ns = base::kNever;
}

}  // namespace detail

using detail::ComponentCore;

const std::string& Context::component_name() const {
  return core_.name;
}
const std::string& Context::application_name() const {
  return core_.application.description().name;
}

void Context::create_thread(std::string name, std::function<void(std::stop_token)> body) {
  detail::assert_constructing(core_, "create_thread()", name);
  core_.threads.push_back({std::move(name), std::move(body)});
}

namespace {

/// Has `job`, the component's job `number`, done by a worker of the executor of this name.
void submit(ComponentCore& core, std::string_view executor, std::uint64_t number,
            std::function<void()> job) {
  const std::vector<std::string> known = host::executor_names(core.application.description());
  const auto found = std::ranges::find(known, executor);
  if (found == known.end()) {
    const std::string hint = config::did_you_mean(config::nearest(executor, known));
    throw std::runtime_error("there is no executor \"" + std::string(executor) +
                             "\" to offload work to" + (hint.empty() ? "" : "; " + hint));
  }
  const std::string call = "offload " + std::to_string(number);
  if (const auto why = core.publishing.replayed_refusal(call)) {
    throw std::runtime_error(*why);
  }
  if (!core.application.time().submit(static_cast<std::size_t>(found - known.begin()), core,
                                      std::move(job))) {
    const std::string why = "executor \"" + *found + "\" has " +
                            std::to_string(detail::Executor::kMaxJobs) +
                            " jobs waiting and takes no more";
    core.publishing.refused(call, why);
    throw std::runtime_error(why);
  }
}

void post_fault_of_work(ComponentCore& core, std::uint64_t key, const std::string& what) {
  core.post(
      detail::Cause::kFault,
      [&core, what] {
        ++core.jobs_ended;
        throw std::runtime_error("offloaded work threw: " + what);
      },
      nullptr, key);
}

void call_behind_work(ComponentCore& core, const std::function<void()>& done) {
  constexpr const char* kCall = "its callback behind offloaded work";
  const detail::CallScope scope(core, kCall);
  const std::string threw = std::string(kCall) + " threw: ";
  try {
    done();
  } catch (const std::exception& exception) {
    throw std::runtime_error(threw + exception.what());
  } catch (...) {
    throw std::runtime_error(threw + "something that is no std::exception");
  }
}

}  // namespace

void Context::offload(std::string_view executor, std::function<void()> work,
                      std::function<void()> done) {
  detail::assert_in_activation(core_, "offload() to", executor, "offload work in a callback");
  ComponentCore& core = core_;
  const std::uint64_t key = ++core.jobs_made;
  submit(core, executor, key,
         [&core, object = core.restart_count, key, work = std::move(work), done = std::move(done)] {
           struct Job {  // Counted for threads that wait for the end.
             ComponentCore& core;
             explicit Job(ComponentCore& its_core) : core(its_core) { core.jobs.fetch_add(1); }
             ~Job() { core.jobs.fetch_sub(1); }
           };
           const Job job(core);
           try {
             const detail::CallScope scope(core, "its offloaded work", nullptr, false);
             work();
           } catch (const std::exception& exception) {
             post_fault_of_work(core, key, exception.what());
             return;
           } catch (...) {
             post_fault_of_work(core, key, "something that is no std::exception");
             return;
           }
           core.post(
               detail::Cause::kJob,
               [&core, done, object] {
                 ++core.jobs_ended;
                 // A restarted component is another object than the one that asked.
                 if (core.state == ComponentCore::State::kActive && core.restart_count == object) {
                   call_behind_work(core, done);
                 }
               },
               nullptr, key);
         });
}

void Context::check_params(ParamCheck check) {
  detail::assert_constructing(core_, "check_params()");
  core_.param_table.add_check(std::move(check));
}

void Context::change_params(std::vector<ParamChange> changes,
                            std::function<void(const ParamsResult&)> done) {
  detail::assert_in_activation(core_, "change_params() of",
                               changes.empty() ? std::string_view() : changes.front().param,
                               "change params in a callback");
  core_.application.change_params(core_, std::move(changes), std::move(done));
}

std::vector<ParamInfo> list_params(Context& context) {
  constexpr std::string_view kName = "params of the application";
  detail::ComponentCore& core = context.core();
  detail::assert_in_activation(core, "list_params() of", context.application_name(),
                               "list params in a callback");
  const auto then = detail::take_observed(core, kName);
  if (then) {
    return host::infos_of(*then);
  }
  std::vector<ParamInfo> infos = core.application.list_params();
  detail::keep_observed(core, kName, host::to_text(infos));
  return infos;
}

Source Context::create_source() {
  core_.is_source = true;
  return Source(core_);
}

void Source::finish() {
  if (!core_->is_source_finished.load()) {
    core_->application.source_finished(*core_);
  }
}

TimeHold::TimeHold(ComponentCore& core) : core_(&core) {
  core_->application.time().hold();
}

TimeHold::~TimeHold() {
  if (core_ != nullptr) {
    core_->application.time().let_go();
  }
}

void Context::dump_flight_recorder(std::string_view reason) {
  core_.application.dump(reason, core_.name, {});
}

void Context::switch_mode(std::string_view mode, std::string_view why) {
  detail::assert_in_activation(core_, "switch_mode() to", mode, "ask for modes in a callback");
  core_.application.ask_mode(mode, why, core_);
}

std::string Context::mode() const {
  const detail::PublishingComponent& publishing = core_.publishing;
  const bool is_kept = publishing.reads != nullptr || publishing.replayed != nullptr;
  if (!is_kept || !publishing.is_active_here()) {
    return core_.application.mode();
  }
  const auto& modes = core_.application.description().modes;
  const std::uint64_t place = publishing.learn(detail::ReadKind::kMode, 0, [&] {
    return std::ranges::find(modes, core_.application.mode(), &config::ModeDescription::name) -
           modes.begin();
  });
  return place < modes.size() ? modes[place].name : std::string();
}

void Context::report(std::string_view name, ReportValue value) {
  core_.results.insert_or_assign(std::string(name), std::move(value));
}

Time Component::now() const {
  return context_.core().publishing.now;
}
Time Component::start_time() const {
  const detail::ComponentCore& core = context_.core();
  const detail::RunningActivation* running = detail::current_activation();
  if (running == nullptr || running->actor != &core || running->record == nullptr) {
    return core.application.start_time();  // A thread of its own.
  }
  return core.timers_began.value_or(core.publishing.now);
}

Log Component::log() const {
  return Log(context_.core().log_source);
}

Random& Component::random() {
  ComponentCore& core = context_.core();
  if (!core.random) {
    core.random.emplace(detail::publisher_id(core.application.description().name, core.name));
  }
  return *core.random;
}

void Component::health(Health state, std::string_view reason) {
  ComponentCore& core = context_.core();
  const bool is_urgent = state != core.health;
  if (is_urgent || reason != core.health_reason) {
    core.health = state;
    core.health_reason = reason;
    core.application.component_changed(core, is_urgent);
  }
}

}  // namespace fastcycle

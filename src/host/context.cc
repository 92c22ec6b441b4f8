// What components ask of their context, answered by the application.

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "config/params.h"
#include "host/application.h"
#include "host/client_core.h"
#include "host/component_core.h"
#include "host/declare.h"
#include "host/server_core.h"

namespace fastcycle {

using host::Application;

namespace detail {
namespace {

void assert_constructing(const ComponentCore& core) {
  FASTCYCLE_ASSERT(core.is_constructing,
                   "parameters, publishers, views and timers are declared in "
                   "the component's constructor");
}

/// Whether a service or an action may have messages of `type`; else adds a mistake.
void check_call_type(ComponentCore& core, const std::string& service,
                     const google::protobuf::Message* type) {
  if (type == nullptr) {
    return;
  }
  for (int number = kFirstHeadField; number <= kLastHeadField; ++number) {
    if (type->GetDescriptor()->FindFieldByNumber(number) != nullptr) {
      core.problems->add(config::mistake(
          core.description.place, "service \"" + service + "\" of component \"" + core.name +
                                      "\": the message " + type->GetTypeName() + " has a field " +
                                      std::to_string(number) + "; calls use the numbers " +
                                      std::to_string(kFirstHeadField) + " to " +
                                      std::to_string(kLastHeadField) + " themselves"));
      return;
    }
  }
}

/// That of `declared` whose name is `service`, or null.
template <typename Core>
Core* find_service(const std::vector<std::unique_ptr<Core>>& declared, const std::string& service) {
  const auto found =
      std::ranges::find_if(declared, [&](const auto& core) { return core->service == service; });
  return found == declared.end() ? nullptr : found->get();
}

/// The next of what a restarted component declares again; it must be what it was.
template <typename T>
T& redeclare(std::vector<T*>& first, std::vector<T*>& again, const std::string& topic) {
  if (again.size() >= first.size() || first[again.size()]->topic.name != topic) {
    throw std::logic_error("a restarted component declares other topics than before: \"" + topic +
                           "\"");
  }
  again.push_back(first[again.size()]);
  return *again.back();
}

}  // namespace

ParamSlot& declare_param(ComponentCore& core, std::unique_ptr<ParamSlot> slot) {
  assert_constructing(core);
  const std::string& name = slot->spec.name;
  const bool is_shared = core.description.params.find_dotted(name) == nullptr;
  const config::Value* value =
      slot->spec.fallback ? core.params->find(name) : core.params->require(name);
  return core.param_table.declare(std::move(slot), value, is_shared, *core.problems);
}

void set_on_change(ComponentCore& core, const ParamSlot& slot, std::function<void()> callback) {
  assert_constructing(core);
  ParamSlot* its_slot = core.param_table.find(slot);
  FASTCYCLE_ASSERT(its_slot != nullptr, "a component waits for changes of its own parameters");
  if (!slot.spec.is_tunable) {
    core.problems->add(config::mistake(
        core.description.place, "component \"" + core.name + "\" waits for changes of its param " +
                                    config::in_quotes(slot.spec.name) +
                                    ", which is not declared as tunable"));
  }
  its_slot->on_change = std::move(callback);
}

PublisherCore& create_publisher(ComponentCore& core, std::string_view topic,
                                const google::protobuf::Message& default_instance,
                                const google::protobuf::Message* prototype, bool is_external) {
  assert_constructing(core);
  return declare_publisher(core, core.declare_topic(topic), default_instance, prototype,
                           is_external);
}

PublisherCore& declare_publisher(ComponentCore& core, const std::string& topic,
                                 const google::protobuf::Message& default_instance,
                                 const google::protobuf::Message* prototype, bool is_external) {
  if (core.is_redeclaring) {
    return redeclare(core.declared.publishers, core.redeclared.publishers, topic);
  }
  PublisherCore& publisher = core.application.topics().add_publisher(
      topic, core.publishing, default_instance, prototype, is_external);
  core.declared.publishers.push_back(&publisher);
  return publisher;
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

CallbackSubscription& declare_subscription(ComponentCore& core, const std::string& topic,
                                           const google::protobuf::Message& default_instance,
                                           const SubscriberOptions& options,
                                           EnvelopeCallback callback) {
  if (core.is_redeclaring) {
    CallbackSubscription& subscription =
        redeclare(core.declared.subscriptions, core.redeclared.subscriptions, topic);
    if (subscription.kind != Subscription::Kind::kCallback) {
      throw std::logic_error("a restarted component subscribes to \"" + topic +
                             "\", which it had synchronized before");
    }
    core.redeclare_subscription(subscription, options, std::move(callback));
    return subscription;
  }
  Topic& its_topic = core.application.topics().get(topic, core.name, default_instance);
  CallbackSubscription& subscription = core.subscribe(its_topic, options, std::move(callback));
  core.declared.subscriptions.push_back(&subscription);
  return subscription;
}

Subscription& create_subscription(ComponentCore& core, std::string_view topic,
                                  const google::protobuf::Message& default_instance,
                                  const SubscriberOptions& options, EnvelopeCallback callback) {
  const std::string name = core.declare_topic(topic);
  if (core.is_constructing) {
    return declare_subscription(core, name, default_instance,
                                core.subscriber_options(topic, options), std::move(callback));
  }
  FASTCYCLE_ASSERT(core.publishing.is_in_activation,
                   "subscriptions are made in the constructor or in a callback");
  return core.application.subscribe_late(
      core, name, default_instance, core.subscriber_options(topic, options), std::move(callback));
}

void end_subscription(Subscription& subscription) noexcept {
  auto& callback = static_cast<CallbackSubscription&>(subscription);
  auto& core = static_cast<ComponentCore&>(callback.actor);
  core.application.end_subscription(core, callback);
}

ClientCore& create_client(ComponentCore& core, std::string_view name,
                          const google::protobuf::Message& request,
                          const google::protobuf::Message& reply,
                          const google::protobuf::Message* feedback, std::size_t max_open) {
  assert_constructing(core);
  const std::string service = core.declare_topic(name);
  for (const auto* type : {&request, &reply, feedback}) {
    check_call_type(core, service, type);
  }
  ClientCore* client = find_service(core.clients, service);
  if (client != nullptr && client->is_declared) {
    client->check_types(*core.problems, request, reply, feedback);
    return *client;
  }
  if (client == nullptr) {
    core.clients.push_back(std::make_unique<ClientCore>(core, service, max_open));
    client = core.clients.back().get();
  }
  client->declare(request, reply, feedback);
  return *client;
}

ServerCore& create_server(ComponentCore& core, std::string_view name, ServerSpec spec) {
  assert_constructing(core);
  const std::string service = core.declare_topic(name);
  for (const auto* type : {&spec.request, &spec.reply, spec.feedback}) {
    check_call_type(core, service, type);
  }
  ServerCore* server = find_service(core.servers, service);
  if (server == nullptr || server->is_declared) {
    if (core.is_redeclaring) {
      throw std::logic_error("a restarted component serves others than before: \"" + service +
                             "\"");
    }
    const std::size_t depth =
        core.subscriber_options(name, {.depth = spec.depth}).depth.value_or(spec.depth);
    core.servers.push_back(std::make_unique<ServerCore>(core, service, depth));
    server = core.servers.back().get();
  }
  server->declare(std::move(spec));
  return *server;
}

View& create_view(ComponentCore& core, std::string_view topic,
                  const google::protobuf::Message& default_instance, std::size_t depth,
                  std::optional<Duration> span) {
  assert_constructing(core);
  const std::string name = core.declare_topic(topic);
  if (core.is_redeclaring) {
    return redeclare(core.declared.views, core.redeclared.views, name);
  }
  Topic& its_topic = core.application.topics().get(name, core.name, default_instance);
  const auto kind =
      depth == 1 && !span ? Subscription::Kind::kLatest : Subscription::Kind::kHistory;
  auto view = std::make_unique<View>(its_topic, core, kind, depth, span,
                                     core.subscriber_options(topic, {}).lifespan);
  View& result = *view;
  its_topic.subscriptions.push_back(std::move(view));
  core.views.push_back(&result);
  core.declared.views.push_back(&result);
  core.publishing.has_subscribers = true;
  return result;
}

std::size_t view_size(const View& view) noexcept {
  return view.held.size();
}
Envelope& view_at(const View& view, std::size_t index) noexcept {
  return *view.held[index];
}
Time view_now(const View& view) noexcept {
  return view.actor.publishing.now;
}

TimerCore& create_timer(ComponentCore& core, const TimerOptions& options, TickCallback callback) {
  assert_constructing(core);
  return core.add_timer(options, std::move(callback));
}

void arm_timer(TimerCore& timer, Time due) noexcept {
  FASTCYCLE_ASSERT(!timer.is_periodic(), "a timer with a period arms itself");
  FASTCYCLE_ASSERT(timer.actor.publishing.is_in_activation,
                   "a component arms its timers only inside its callbacks");
  timer.actor.arm(timer, due);
}

void cancel_timer(TimerCore& timer) noexcept {
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
  if (!core_.is_redeclaring) {
    detail::assert_constructing(core_);
    core_.threads.push_back({std::move(name), std::move(body)});
  }
}

void Context::offload(std::string_view executor, std::function<void()> work,
                      std::function<void()> done) {
  FASTCYCLE_ASSERT(core_.publishing.is_in_activation, "work is offloaded inside a callback");
  ComponentCore& core = core_;
  core.application.submit(
      std::string(executor), core,
      [&core, object = core.restart_count, work = std::move(work), done = std::move(done)] {
        try {
          work();
        } catch (const std::exception& exception) {
          core.post(detail::Cause::kFault, [what = std::string(exception.what())] {
            throw std::runtime_error("offloaded work threw: " + what);
          });
          return;
        } catch (...) {
          core.post(detail::Cause::kFault,
                    [] { throw std::runtime_error("offloaded work threw"); });
          return;
        }
        core.post(detail::Cause::kJob, [&core, done, object] {
          // A restarted component is another object than the one that asked.
          if (core.state == ComponentCore::State::kActive && core.restart_count == object) {
            done();
          }
        });
      });
}

void Context::check_params(ParamCheck check) {
  detail::assert_constructing(core_);
  core_.param_table.add_check(std::move(check));
}

void Context::change_params(std::vector<ParamChange> changes,
                            std::function<void(const ParamsResult&)> done) {
  FASTCYCLE_ASSERT(core_.publishing.is_in_activation, "params are changed inside a callback");
  core_.application.change_params(core_, std::move(changes), std::move(done));
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
  core_->application.hold_time();
}

TimeHold::~TimeHold() {
  if (core_ != nullptr) {
    core_->application.let_time_go();
  }
}

void Context::dump_flight_recorder(std::string_view reason) {
  core_.application.dump(reason, core_.name);
}

void Context::switch_mode(std::string_view mode, std::string_view why) {
  FASTCYCLE_ASSERT(core_.publishing.is_in_activation,
                   "a component asks for modes in its callbacks");
  core_.application.modes().ask(mode, why, &core_);
}

std::string Context::mode() const {
  return core_.application.modes().current();
}

void Context::report(std::string_view name, ReportValue value) {
  core_.results.insert_or_assign(std::string(name), std::move(value));
}

Time Component::now() const {
  return context_.core().publishing.now;
}
Time Component::start_time() const {
  return context_.core().application.start_time();
}

Log Component::log() const {
  ComponentCore& core = context_.core();
  return {core.application.log_queue(), core.name};
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

#include "bench.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/message.h>
#include <nlohmann/json.hpp>

#include "component/component_core.h"
#include "fastcycle/service.h"
#include "host/build_for_bench.h"
#include "loading/component_library.h"
#include "not_found.h"

namespace fastcycle::python {
namespace {

namespace pb = google::protobuf;
using nlohmann::json;

constexpr const char* kOwnLibrary = "bench";
constexpr std::size_t kDepth = 65536;

// ---- Messages by the names of their types ----

const pb::Descriptor& descriptor_of(const std::string& type) {
  const pb::Descriptor* const found =
      pb::DescriptorPool::generated_pool()->FindMessageTypeByName(type);
  if (found == nullptr) {
    throw NotFound(fmt::format("no component of the bench knows the message type \"{}\"", type));
  }
  return *found;
}

const pb::Message* instance_of(const std::string& type) {
  return pb::MessageFactory::generated_factory()->GetPrototype(&descriptor_of(type));
}

void add_file(const pb::FileDescriptor& file, std::set<const pb::FileDescriptor*>& added,
              pb::FileDescriptorSet& set) {
  if (!added.insert(&file).second) {
    return;
  }
  for (int i = 0; i < file.dependency_count(); ++i) {
    add_file(*file.dependency(i), added, set);
  }
  file.CopyTo(set.add_file());
}

std::unique_ptr<pb::Message> parsed_as(const pb::Message& type, const std::string& bytes) {
  std::unique_ptr<pb::Message> message(type.New());
  if (!message->ParseFromString(bytes)) {
    throw std::runtime_error("bytes that are no " + message->GetTypeName());
  }
  return message;
}

// ---- The components of the bench itself ----

/// Publishes what a test says.
class Input final : public Component {
 public:
  explicit Input(Context& context)
      : Component(context),
        type_(*instance_of(context.param<std::string>("type").get())),
        publisher_(detail::create_publisher(
            context.core(), context.param<std::string>("topic").get(), type_, nullptr, false)) {}

  [[nodiscard]] const pb::Message& type() const { return type_; }

  void publish(const pb::Message& message, const PublishOptions& options) {
    detail::Envelope* const loan = detail::take_loan(publisher_, true);
    loan->own->CopyFrom(message);
    detail::publish_loan(publisher_, loan, options);
  }

 private:
  const pb::Message& type_;
  detail::PublisherCore& publisher_;
};

/// Keeps what it receives until the test takes it.
class Output final : public Component {
 public:
  explicit Output(Context& context) : Component(context) {
    detail::create_subscription(
        context.core(), context.param<std::string>("topic").get(),
        *instance_of(context.param<std::string>("type").get()), {.depth = kDepth},
        [this](detail::Envelope& envelope, const pb::Message& payload) {
          const MessageInfo& info = envelope.info;
          received.push_back({.message = payload.SerializeAsString(),
                              .publish_time_ns = info.publish_time.time_since_epoch().count(),
                              .sequence = info.sequence,
                              .taken_ns = info.origin.taken.time_since_epoch().count()});
        });
  }

  std::vector<Bench::Received> received;
};

/// Calls a service for a test.
class Asker final : public Component {
 public:
  explicit Asker(Context& context)
      : Component(context),
        request_(*instance_of(context.param<std::string>("request").get())),
        client_(detail::create_client(
            context.core(), context.param<std::string>("service").get(), request_,
            *instance_of(context.param<std::string>("reply").get()), nullptr, kMostOpen)) {}

  [[nodiscard]] const pb::Message& type() const { return request_; }

  void call(const pb::Message& request, std::optional<Duration> deadline, std::size_t index) {
    detail::PublisherCore& publisher = detail::request_publisher(client_);
    detail::Envelope* const loan = detail::take_loan(publisher, true);
    loan->own->CopyFrom(request);
    const CallOptions options{.deadline = deadline};
    numbers.push_back(detail::call(
        client_, loan, options,
        [this, index](CallStatus status, std::string_view error, detail::Envelope* reply) {
          answers.at(index) = {
              .status = to_word(status),
              .error = std::string(error),
              .reply = reply == nullptr ? std::string() : reply->payload->SerializeAsString()};
        },
        {}));
  }

  void cancel(std::size_t index) { detail::cancel_call(client_, numbers.at(index)); }

  std::vector<std::optional<Bench::Answer>> answers;
  std::vector<std::uint64_t> numbers;  ///< By which the client knows the calls.

 private:
  static constexpr std::size_t kMostOpen = 256;

  const pb::Message& request_;
  detail::ClientCore& client_;
};

/// Answers requests as a test says.
class Server final : public Component {
 public:
  explicit Server(Context& context)
      : Component(context), reply_(*instance_of(context.param<std::string>("reply").get())) {
    detail::create_server(
        context.core(), context.param<std::string>("service").get(),
        {.request = *instance_of(context.param<std::string>("request").get()),
         .reply = reply_,
         .depth = kMostOwed,
         .defers = true,
         .callback = [this](detail::Envelope&, const pb::Message& request, detail::Ticket ticket) {
           on_request(request, ticket);
         }});
  }

  [[nodiscard]] const pb::Message& type() const { return reply_; }

  void answer(std::size_t index, const pb::Message& reply) {
    const detail::Ticket ticket = tickets.at(index);
    if (!detail::is_owed(ticket)) {
      return;
    }
    detail::PublisherCore& publisher = detail::reply_publisher(ticket);
    detail::Envelope* const loan = detail::take_loan(publisher, true);
    loan->own->CopyFrom(reply);
    detail::answer(ticket, CallStatus::kOk, {}, loan, &publisher);
  }

  void reject(std::size_t index, const std::string& reason) {
    detail::answer(tickets.at(index), CallStatus::kRejected, reason, nullptr, nullptr);
  }

  Bench::Handler handler;                                  ///< Or none: requests are taken.
  std::vector<detail::Ticket> tickets;                     ///< Of all requests.
  std::vector<std::pair<std::size_t, std::string>> asked;  ///< Not taken yet, by their places.

 private:
  static constexpr std::size_t kMostOwed = 256;

  void on_request(const pb::Message& request, detail::Ticket ticket) {
    tickets.push_back(ticket);
    const std::size_t index = tickets.size() - 1;
    if (!handler) {
      asked.emplace_back(index, request.SerializeAsString());
      return;
    }
    const Bench::Handled handled = handler(request.SerializeAsString());
    if (!handled.reply) {
      reject(index, handled.reason);
      return;
    }
    answer(index, *parsed_as(reply_, *handled.reply));
  }

  const pb::Message& reply_;
};

constexpr ComponentClass kInput{"Input", &detail::create_component<Input>,
                                &detail::destroy_component<Input>};
constexpr ComponentClass kOutput{"Output", &detail::create_component<Output>,
                                 &detail::destroy_component<Output>};
constexpr ComponentClass kAsker{"Asker", &detail::create_component<Asker>,
                                &detail::destroy_component<Asker>};
constexpr ComponentClass kServer{"Server", &detail::create_component<Server>,
                                 &detail::destroy_component<Server>};
constexpr std::array kOwnClasses{&kInput, &kOutput, &kAsker, &kServer};

/// Those of the bench, and those of libraries.
class Classes final : public host::ComponentClasses {
 public:
  explicit Classes(std::vector<std::filesystem::path> folders) : loader_(std::move(folders)) {}

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override {
    if (component.library != kOwnLibrary) {
      return loader_.find(component, problems);
    }
    return *std::ranges::find(kOwnClasses, component.class_name,
                              [](const ComponentClass* one) { return std::string(one->name); });
  }

 private:
  host::LibraryLoader loader_;
};

json parsed(const std::string& text, const char* of) {
  json result = json::parse(text, nullptr, false, true);
  if (!result.is_object()) {
    throw std::runtime_error(fmt::format("{} is no JSON object: {}", of, text));
  }
  return result;
}

std::vector<std::filesystem::path> with_installed(std::vector<std::filesystem::path> folders) {
  folders.push_back(host::core_library_folder() / "fastcycle");
  return folders;
}

}  // namespace

struct Bench::State {
  explicit State(std::vector<std::filesystem::path> folders)
      : classes(with_installed(std::move(folders))) {}

  json application = {{"name", "bench"}, {"components", json::array()}};
  json own = json::array();  ///< Components of the bench, behind those that bring their types.
  std::map<std::string, Handler> handlers;  ///< Of its services, until it is started.
  Classes classes;
  std::unique_ptr<host::Application> running;

  [[nodiscard]] host::Application& application_that_runs() const {
    if (running == nullptr) {
      throw std::runtime_error("the bench was not started");
    }
    return *running;
  }

  [[nodiscard]] detail::ComponentCore& core(const std::string& name) const {
    for (const auto& component : application_that_runs().components()) {
      if (component->name == name) {
        return *component;
      }
    }
    throw NotFound(fmt::format("the bench has no component \"{}\"", name));
  }

  template <typename T>
  T& own_component(const std::string& name) const {
    Component* const found = core(name).component;
    if (found == nullptr) {
      throw std::runtime_error("the bench was stopped");
    }
    return static_cast<T&>(*found);
  }

  std::string add_own(const char* class_name, json params) {
    if (running != nullptr) {
      throw std::runtime_error(
          "inputs, outputs, clients and services are added before the bench is started");
    }
    std::string name = fmt::format("bench_{}_{}", class_name, own.size() + 1);
    own.push_back({{"name", name},
                   {"library", kOwnLibrary},
                   {"class", class_name},
                   {"params", std::move(params)}});
    return name;
  }

  void post(const std::string& name, detail::Cause cause, std::function<void()> body) const {
    core(name).post(cause, std::move(body));
    running->settle();
  }
};

Bench::Bench(std::vector<std::filesystem::path> folders)
    : state_(std::make_unique<State>(std::move(folders))) {}

Bench::~Bench() {
  if (state_->running != nullptr) {
    state_->running->stop();
  }
}

void Bench::add(const std::string& configuration) {
  if (state_->running != nullptr) {
    throw std::runtime_error("components are added before the bench is started");
  }
  state_->application["components"].push_back(parsed(configuration, "a component"));
}

void Bench::configure(const std::string& application) {
  state_->application.merge_patch(parsed(application, "the application"));
}

std::string Bench::add_input(const std::string& topic, const std::string& type) {
  return state_->add_own(kInput.name, {{"topic", topic}, {"type", type}});
}

std::string Bench::add_output(const std::string& topic, const std::string& type) {
  return state_->add_own(kOutput.name, {{"topic", topic}, {"type", type}});
}

std::string Bench::add_client(const std::string& service, const std::string& request,
                              const std::string& reply) {
  return state_->add_own(kAsker.name,
                         {{"service", service}, {"request", request}, {"reply", reply}});
}

std::string Bench::add_service(const std::string& service, const std::string& request,
                               const std::string& reply, Handler handler) {
  std::string name =
      state_->add_own(kServer.name, {{"service", service}, {"request", request}, {"reply", reply}});
  state_->handlers[name] = std::move(handler);
  return name;
}

void Bench::start() {
  if (state_->running != nullptr) {
    throw std::runtime_error("the bench was started already");
  }
  json application = state_->application;
  for (const json& component : state_->own) {
    application["components"].push_back(component);
  }
  state_->running = host::build_for_bench(application.dump(), state_->classes);
  for (auto& [name, handler] : state_->handlers) {
    state_->own_component<Server>(name).handler = std::move(handler);
  }
  state_->running->start();
  state_->running->settle();
}

bool Bench::is_started() const {
  return state_->running != nullptr;
}

void Bench::advance(Duration span) {
  state_->application_that_runs().advance_to(now() + span);
}

void Bench::stop() {
  state_->application_that_runs().stop();
}

Time Bench::now() const {
  return state_->application_that_runs().clock().now();
}

void Bench::publish(const std::string& input, const std::string& message,
                    std::optional<Time> taken) {
  auto& component = state_->own_component<Input>(input);
  const auto content = parsed_as(component.type(), message);
  state_->post(input, detail::Cause::kExternal,
               [&] { component.publish(*content, {.taken_at = taken}); });
}

std::vector<Bench::Received> Bench::take(const std::string& output) {
  return std::exchange(state_->own_component<Output>(output).received, {});
}

std::size_t Bench::call(const std::string& client, const std::string& request,
                        std::optional<Duration> deadline) {
  auto& component = state_->own_component<Asker>(client);
  const auto content = parsed_as(component.type(), request);
  const std::size_t index = component.answers.size();
  component.answers.emplace_back();
  state_->post(client, detail::Cause::kExternal,
               [&] { component.call(*content, deadline, index); });
  return index;
}

std::optional<Bench::Answer> Bench::answer_of(const std::string& client, std::size_t call) const {
  return state_->own_component<Asker>(client).answers.at(call);
}

void Bench::cancel(const std::string& client, std::size_t call) {
  auto& component = state_->own_component<Asker>(client);
  state_->post(client, detail::Cause::kExternal, [&] { component.cancel(call); });
}

std::vector<std::pair<std::size_t, std::string>> Bench::take_requests(const std::string& service) {
  return std::exchange(state_->own_component<Server>(service).asked, {});
}

void Bench::answer(const std::string& service, std::size_t request, const std::string& reply) {
  auto& component = state_->own_component<Server>(service);
  const auto content = parsed_as(component.type(), reply);
  state_->post(service, detail::Cause::kExternal, [&] { component.answer(request, *content); });
}

void Bench::reject(const std::string& service, std::size_t request, const std::string& reason) {
  auto& component = state_->own_component<Server>(service);
  state_->post(service, detail::Cause::kExternal, [&] { component.reject(request, reason); });
}

ParamsResult Bench::change_params(const std::vector<ParamChange>& changes) {
  ParamsResult result = state_->application_that_runs().change_params(changes);
  state_->running->settle();
  return result;
}

void Bench::switch_mode(const std::string& mode) {
  state_->application_that_runs().switch_mode(mode, "the test asks for it");
  state_->running->settle();
}

std::string Bench::mode() const {
  return state_->application_that_runs().modes().current();
}

void Bench::activate(const std::string& name) {
  detail::ComponentCore& core = state_->core(name);
  state_->post(name, detail::Cause::kMode, [&core] { core.call_activate(); });
}

void Bench::deactivate(const std::string& name) {
  detail::ComponentCore& core = state_->core(name);
  state_->post(name, detail::Cause::kMode, [&core] { core.call_deactivate(); });
}

bool Bench::is_active(const std::string& name) const {
  return state_->core(name).state == detail::ComponentCore::State::kActive;
}

std::vector<std::pair<std::string, ReportValue>> Bench::results(const std::string& name) const {
  const auto& results = state_->core(name).results;
  return {results.begin(), results.end()};
}

std::vector<std::string> Bench::faults(const std::string& name) const {
  return state_->core(name).faults;
}

std::string schema_of_type(const std::string& type) {
  std::set<const pb::FileDescriptor*> added;
  pb::FileDescriptorSet set;
  add_file(*descriptor_of(type).file(), added, set);
  return set.SerializeAsString();
}

}  // namespace fastcycle::python

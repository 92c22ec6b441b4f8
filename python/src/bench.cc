#include "bench.h"

#include <set>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/message.h>
#include <nlohmann/json.hpp>

#include "component/component_core.h"
#include "config/describe.h"
#include "config/parse.h"
#include "host/application.h"
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

const pb::Message& instance_of(const std::string& type) {
  return *pb::MessageFactory::generated_factory()->GetPrototype(&descriptor_of(type));
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

// ---- The components of the bench itself ----

/// Publishes what a test says.
class Input final : public Component {
 public:
  explicit Input(Context& context)
      : Component(context),
        type_(instance_of(context.param<std::string>("type").get())),
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

/// Keeps what it hears until the test takes it.
class Output final : public Component {
 public:
  explicit Output(Context& context) : Component(context) {
    detail::create_subscription(
        context.core(), context.param<std::string>("topic").get(),
        instance_of(context.param<std::string>("type").get()), {.depth = kDepth},
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

constexpr ComponentClass kInput{"Input", &detail::create_component<Input>,
                                &detail::destroy_component<Input>};
constexpr ComponentClass kOutput{"Output", &detail::create_component<Output>,
                                 &detail::destroy_component<Output>};

/// Those of the bench, and those of libraries.
class Classes final : public host::ComponentClasses {
 public:
  explicit Classes(std::vector<std::filesystem::path> folders) : loader_(std::move(folders)) {}

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override {
    if (component.library != kOwnLibrary) {
      return loader_.find(component, problems);
    }
    return component.class_name == kInput.name ? &kInput : &kOutput;
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

void throw_if_wrong(const config::Problems& problems) {
  if (!problems.has_errors()) {
    return;
  }
  std::string text;
  for (const config::Problem& problem : problems.all()) {
    text += (text.empty() ? "" : "\n") + config::to_string(problem);
  }
  throw std::runtime_error(text);
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

  std::string add_own(const char* class_name, const std::string& topic, const std::string& type) {
    if (running != nullptr) {
      throw std::runtime_error("inputs and outputs are added before the bench is started");
    }
    std::string name = fmt::format("bench_{}_{}", class_name, own.size() + 1);
    own.push_back({{"name", name},
                   {"library", kOwnLibrary},
                   {"class", class_name},
                   {"params", {{"topic", topic}, {"type", type}}}});
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
  return state_->add_own(kInput.name, topic, type);
}

std::string Bench::add_output(const std::string& topic, const std::string& type) {
  return state_->add_own(kOutput.name, topic, type);
}

void Bench::start() {
  if (state_->running != nullptr) {
    throw std::runtime_error("the bench was started already");
  }
  json application = state_->application;
  for (const json& component : state_->own) {
    application["components"].push_back(component);
  }
  config::Problems problems;
  const auto source = std::make_shared<config::Source>(config::Source{"bench", {}, false});
  const auto tree = config::parse(application.dump(), source, problems);
  throw_if_wrong(problems);
  config::ApplicationDescription description = config::describe(*tree);
  config::check_sense(description, problems);
  throw_if_wrong(problems);
  auto running = std::make_unique<host::Application>(
      std::move(description), host::ClockOptions{.is_simulated = true, .workers = 1});
  running->own_topics_are_free = true;
  running->build(state_->classes, problems, host::ConstructorFault::kMistake);
  throw_if_wrong(problems);
  state_->running = std::move(running);
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
  const std::unique_ptr<pb::Message> content(component.type().New());
  if (!content->ParseFromString(message)) {
    throw std::runtime_error("bytes that are no " + content->GetTypeName());
  }
  state_->post(input, detail::Cause::kExternal,
               [&] { component.publish(*content, {.taken_at = taken}); });
}

std::vector<Bench::Received> Bench::take(const std::string& output) {
  return std::exchange(state_->own_component<Output>(output).received, {});
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

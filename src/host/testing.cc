#include "fastcycle/testing.h"

#include <map>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "host/build_for_bench.h"

namespace fastcycle::testing {
namespace {

using nlohmann::json;

json parse_configuration(std::string_view text, const std::string& of) {
  json parsed = json::parse(text, nullptr, false, true);
  if (!parsed.is_object()) {
    throw std::runtime_error("the configuration of " + of +
                             " is no JSON object: " + std::string(text));
  }
  return parsed;
}

/// The classes that a test gave, by component.
class GivenClasses final : public host::ComponentClasses {
 public:
  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems&) override {
    return &classes.at(component.name);
  }

  std::map<std::string, ComponentClass> classes;
};

}  // namespace

struct Bench::State {
  json application = {{"name", "bench"}, {"components", json::array()}};
  GivenClasses classes;
  std::unique_ptr<host::Application> running;
  std::vector<std::function<void()>> steps;  ///< Before the start.
  int count = 0;

  [[nodiscard]] fastcycle::detail::ComponentCore& core(const std::string& name) const {
    if (running != nullptr) {
      for (const auto& component : running->components()) {
        if (component->name == name) {
          return *component;
        }
      }
    }
    throw std::runtime_error("the bench runs no component \"" + name + "\"");
  }
};

Bench::Bench() : state_(std::make_unique<State>()) {}

Bench::~Bench() {
  if (state_->running != nullptr) {
    state_->running->stop();
  }
}

void Bench::add_class(const std::string& name, std::string_view configuration,
                      const ComponentClass& component_class) {
  json component = parse_configuration(configuration, "component \"" + name + "\"");
  component["name"] = name;
  component["library"] = "bench";
  state_->application["components"].push_back(std::move(component));
  state_->classes.classes[name] = component_class;
}

void Bench::configure(std::string_view application) {
  state_->application.merge_patch(parse_configuration(application, "the application"));
}

void Bench::start() {
  state_->running = host::build_for_bench(state_->application.dump(), state_->classes);
  for (const auto& step : state_->steps) {
    step();
  }
  state_->running->start();
  state_->running->settle();
}

void Bench::advance(Duration span) {
  state_->running->advance_to(now() + span);
}

void Bench::switch_mode(const std::string& mode) {
  state_->running->switch_mode(mode, "the test asks for it");
  state_->running->settle();
}

std::string Bench::mode() const {
  return state_->running->modes().current();
}

void Bench::activate(const std::string& name) {
  auto& core = state_->core(name);
  core.post(fastcycle::detail::Cause::kMode, [&core] { core.call_activate(); });
  state_->running->settle();
}

void Bench::deactivate(const std::string& name) {
  auto& core = state_->core(name);
  core.post(fastcycle::detail::Cause::kMode, [&core] { core.call_deactivate(); });
  state_->running->settle();
}

bool Bench::is_active(const std::string& name) const {
  return state_->core(name).state == fastcycle::detail::ComponentCore::State::kActive;
}

ParamsResult Bench::change_params(const std::vector<ParamChange>& changes) {
  ParamsResult result = state_->running->change_params(changes);
  state_->running->settle();
  return result;
}

void Bench::stop() {
  state_->running->stop();
}

Time Bench::now() const {
  return state_->running->clock().now();
}

ReportValue Bench::result(const std::string& name, const std::string& result) const {
  return state_->core(name).results.at(result);
}

std::vector<std::string> Bench::faults(const std::string& name) const {
  return state_->core(name).faults;
}

Component& Bench::component(const std::string& name) const {
  Component* found = state_->core(name).component;
  if (found == nullptr) {
    throw std::runtime_error("the component \"" + name + "\" of the bench is stopped");
  }
  return *found;
}

void Bench::prepare(std::function<void()> step) {
  state_->steps.push_back(std::move(step));
}

void Bench::run_in(const std::string& name, std::function<void()> body) {
  state_->core(name).post(fastcycle::detail::Cause::kExternal, std::move(body));
  state_->running->settle();
}

std::string Bench::next_name(std::string_view kind) {
  return "bench_" + std::string(kind) + "_" + std::to_string(++state_->count);
}

}  // namespace fastcycle::testing

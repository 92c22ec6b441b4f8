#pragma once

// For tests: an application from JSON text and classes that the test defines.

#include <concepts>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "config/describe.h"
#include "config/parse.h"
#include "host/application.h"

namespace fastcycle::host {

/// Component classes by the name that stands under "library".
class TestClasses : public ComponentClasses {
 public:
  template <std::derived_from<Component> T>
  TestClasses& with(const std::string& library) {
    classes_[library] = {"Test", &fastcycle::detail::create_component<T>,
                         &fastcycle::detail::destroy_component<T>};
    return *this;
  }

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override {
    const auto found = classes_.find(component.library);
    if (found == classes_.end()) {
      problems.add(config::make_error(component.place, "no class " + component.library));
      return nullptr;
    }
    return &found->second;
  }

 private:
  std::map<std::string, ComponentClass> classes_;
};

inline config::ApplicationDescription describe_text(std::string_view text,
                                                    config::Problems& problems) {
  const auto source = std::make_shared<config::Source>(config::Source{"test.json", {}, true});
  const auto tree = config::parse(text, source, problems);
  config::ApplicationDescription description = config::describe(*tree);
  config::check_sense(description, problems);
  return description;
}

/// Builds it; a test failure if it has errors.
inline std::unique_ptr<Application> make_application(std::string_view text, TestClasses& classes,
                                                     const ClockOptions& clock = {}) {
  config::Problems problems;
  auto application = std::make_unique<Application>(describe_text(text, problems), clock);
  application->build(classes, problems, ConstructorFault::kFault);
  for (const config::Problem& problem : problems.all()) {
    if (!problem.warning) {
      throw std::runtime_error(config::to_string(problem));
    }
  }
  return application;
}

/// The ledger of `component`'s only subscription to `topic`.
inline detail::Ledger ledger_of(Application& application, const std::string& topic,
                                const std::string& component) {
  for (const auto& subscription : application.topics().find(topic)->subscriptions) {
    if (subscription->component == component) {
      return subscription->ledger();
    }
  }
  throw std::runtime_error(component + " does not subscribe to " + topic);
}

}  // namespace fastcycle::host

#include "host/build_for_trial.h"

#include <utility>

#include "host/application.h"
#include "host/application_wiring.h"

namespace fastcycle::host {

BuiltForTrial build_for_trial(
    config::ApplicationDescription description, ComponentClasses& classes,
    ConstructorFault on_throw, bool is_part,
    const std::function<void(const std::string& component)>& before_construct,
    config::Problems& problems) {
  auto application = std::make_shared<Application>(
      std::move(description), ClockOptions{.is_simulated = true, .workers = 1});
  application->before_construct = before_construct;
  if (is_part) {
    application->construct_only(classes, problems);
  } else {
    application->build(classes, problems, on_throw);
  }
  return {.kept = application,
          .wiring = problems.has_errors() ? "" : to_text(wiring_of(*application))};
}

}  // namespace fastcycle::host

#include "host/build_for_bench.h"

#include <stdexcept>
#include <utility>

#include "config/describe.h"
#include "config/parse.h"

namespace fastcycle::host {
namespace {

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

}  // namespace

std::unique_ptr<Application> build_for_bench(const std::string& application,
                                             ComponentClasses& classes) {
  config::Problems problems;
  const auto source = std::make_shared<config::Source>(config::Source{"bench", {}, false});
  const auto tree = config::parse(application, source, problems);
  throw_if_wrong(problems);
  config::ApplicationDescription description = config::describe(*tree);
  config::check_sense(description, problems);
  throw_if_wrong(problems);
  auto built = std::make_unique<Application>(std::move(description),
                                             ClockOptions{.is_simulated = true, .workers = 1});
  built->own_topics_are_free = true;
  built->build(classes, problems, ConstructorFault::kError);
  throw_if_wrong(problems);
  return built;
}

}  // namespace fastcycle::host

#include "configuration.h"

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "duration.h"
#include "host/component_library.h"
#include "option_values.h"

namespace fastcycle::tool {
namespace {

std::string counted(std::size_t count, const std::string& word) {
  return std::to_string(count) + " " + word + (count == 1 ? "" : "s");
}

/// An option that takes one value and may be said again and again.
template <typename T>
void add_repeatable(CLI::App& line, const std::string& name, T& values, const std::string& value,
                    const std::string& text) {
  line.add_option(name, values, text)->allow_extra_args(false)->type_name(value);
}

}  // namespace

void Configuration::add_to(CLI::App& line) {
  line.add_option("application", load.file, "The application's JSON file")
      ->required()
      ->type_name("FILE");
  add_repeatable(line, "--set", load.sets, "C.P=VALUE",
                 "Set param P of component C; further dots reach into objects. Repeatable");
  add_repeatable(line, "--var", load.variables, "NAME=VALUE",
                 "Set a variable of the application, ${NAME}. Repeatable");
  add_repeatable(line, "--overlay", load.overlays, "FILE",
                 "Merge this file over the application, in the order given. Repeatable");
  add_repeatable(line, "--library-path", library_path, "DIR",
                 "Look for component libraries here first. Repeatable");
  line.add_option("--load-timeout", load_timeout,
                  "Limit of loading a library or constructing a component (10s)")
      ->type_name("TIME")
      ->check(is_time());
}

config::ApplicationDescription Configuration::read(host::ConstructorFault on_throw,
                                                   config::Problems& problems,
                                                   TrialWarnings warnings) const {
  config::ApplicationDescription description = config::load(load, problems);
  if (!description.components.empty()) {
    config::Problems tried;
    host::try_application(
        {.load = load,
         .library_path = library_path,
         .on_throw = on_throw,
         .limit = std::chrono::ceil<std::chrono::milliseconds>(*parse_duration(load_timeout))},
        tried);
    for (config::Problem& problem : tried.all()) {
      if (!problem.warning || warnings == TrialWarnings::kHeard) {
        problems.add(std::move(problem));
      }
    }
  }
  return description;
}

std::unique_ptr<host::Application> Configuration::make_unstarted() const {
  const std::string file = load.file.string();
  config::Problems problems;
  const config::ApplicationDescription description =
      read(host::ConstructorFault::kMistake, problems);
  if (!may_start(problems, file)) {
    return nullptr;
  }
  host::LibraryLoader libraries(host::library_folders(description, library_path));
  auto application = std::make_unique<host::Application>(
      description, host::ClockOptions{.is_simulated = true, .workers = 1});
  config::Problems found_now;
  application->build(libraries, found_now, host::ConstructorFault::kMistake);
  if (found_now.has_errors()) {
    static_cast<void>(may_start(found_now, file));
    return nullptr;
  }
  return application;
}

void print(const config::Problems& problems) {
  for (const config::Problem& problem : problems.all()) {
    std::fprintf(stderr, "%s\n", config::to_string(problem).c_str());
  }
}

std::string summary(const config::Problems& problems, const std::string& file) {
  // Each is counted once, however often it was found.
  const std::vector<config::Problem> all = problems.all();
  const auto warnings = static_cast<std::size_t>(
      std::ranges::count_if(all, [](const config::Problem& problem) { return problem.warning; }));
  const std::size_t mistakes = all.size() - warnings;
  std::string text = file + ": ";
  text += mistakes == 0 ? "no mistakes" : counted(mistakes, "mistake");
  if (warnings > 0) {
    text += ", " + counted(warnings, "warning");
  }
  return text;
}

bool may_start(const config::Problems& problems, const std::string& file) {
  print(problems);
  if (problems.has_errors()) {
    std::fprintf(stderr, "%s; nothing was started\n", summary(problems, file).c_str());
    return false;
  }
  return true;
}

}  // namespace fastcycle::tool

#include "configuration.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <set>
#include <utility>

#include "duration.h"
#include "loading/component_library.h"
#include "option_values.h"
#include "print.h"

namespace fastcycle::tool {
namespace {

std::string counted(std::size_t count, const std::string& word) {
  return std::to_string(count) + " " + word + (count == 1 ? "" : "s");
}

/// An option that takes one value and may be repeated.
template <typename T>
void add_repeatable(CLI::App& line, const std::string& name, T& values, const std::string& value,
                    const std::string& text) {
  line.add_option(name, values, text)->allow_extra_args(false)->type_name(value);
}

/// Says where each library comes from, in the order of the components.
void print_files(const config::ApplicationDescription& description,
                 const host::LibraryLoader& libraries) {
  std::set<std::string> known;
  for (const config::ComponentDescription& component : description.components) {
    if (!component.library.empty() && known.insert(component.library).second) {
      const std::filesystem::path file = libraries.file_of(component.library);
      print_to(stderr, "library \"{}\": {}\n", component.library,
               file.empty() ? "not found" : file.native());
    }
  }
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
                 "Merge this overlay into the application, in the order given. Repeatable");
  add_repeatable(line, "--isolate", load.isolated, "NAME|all",
                 "Run this component, or each that matches a pattern such as camera/*, or all, in "
                 "a separate process, unless the application assigns one. Repeatable");
  add_repeatable(line, "--library-path", library_path, "DIR",
                 "Search this folder first for component libraries. Repeatable");
  line.add_option("--load-timeout", load_timeout,
                  "Time limit for loading a library or constructing a component (10s)")
      ->type_name("TIME")
      ->check(is_time());
  line.add_flag("-v,--verbose", is_verbose, "Print the file of each component library");
}

config::ApplicationDescription Configuration::read(host::ConstructorFault on_throw,
                                                   config::Problems& problems,
                                                   TrialWarnings warnings,
                                                   host::TrialResult* tried) const {
  config::ApplicationDescription description = config::load(load, problems);
  if (is_verbose) {
    print_files(description, host::LibraryLoader(host::library_folders(description, library_path)));
  }
  if (!description.components.empty()) {
    config::Problems found;
    host::TrialResult result = host::try_application(
        {.load = load,
         .library_path = library_path,
         .on_throw = on_throw,
         .limit = std::chrono::ceil<std::chrono::milliseconds>(*parse_duration(load_timeout)),
         .on_slow =
             [](const std::string& sentence) { print_to(stderr, "fastcycle: {}\n", sentence); }},
        found);
    if (tried != nullptr) {
      *tried = std::move(result);
    }
    for (config::Problem& problem : found.all()) {
      if (!problem.warning || warnings == TrialWarnings::kReported) {
        problems.add(std::move(problem));
      }
    }
  }
  return description;
}

std::unique_ptr<host::Application> Configuration::make_unstarted() const {
  const std::string file = load.file.string();
  config::Problems problems;
  host::TrialResult tried;
  const config::ApplicationDescription description =
      read(host::ConstructorFault::kError, problems, TrialWarnings::kReported, &tried);
  if (!may_start(problems, file)) {
    return nullptr;
  }
  host::LibraryLoader libraries(host::library_folders(description, library_path),
                                description.libraries);
  libraries.expect(std::move(tried.files));
  auto application = std::make_unique<host::Application>(
      description, host::ClockOptions{.is_simulated = true, .workers = 1});
  config::Problems found_now;
  application->build(libraries, found_now, host::ConstructorFault::kError);
  if (found_now.has_errors()) {
    static_cast<void>(may_start(found_now, file));
    return nullptr;
  }
  return application;
}

void print(const config::Problems& problems) {
  for (const config::Problem& problem : problems.all()) {
    print_to(stderr, "{}\n", config::to_string(problem));
  }
}

std::string summary(const config::Problems& problems, const std::string& file) {
  // Each is counted once, however often it was found.
  const std::vector<config::Problem> all = problems.all();
  const auto warnings = static_cast<std::size_t>(
      std::ranges::count_if(all, [](const config::Problem& problem) { return problem.warning; }));
  const std::size_t errors = all.size() - warnings;
  std::string text = file + ": ";
  text += errors == 0 ? "no errors" : counted(errors, "error");
  if (warnings > 0) {
    text += ", " + counted(warnings, "warning");
  }
  return text;
}

bool may_start(const config::Problems& problems, const std::string& file) {
  print(problems);
  if (problems.has_errors()) {
    print_to(stderr, "{}; nothing was started\n", summary(problems, file));
    return false;
  }
  return true;
}

}  // namespace fastcycle::tool

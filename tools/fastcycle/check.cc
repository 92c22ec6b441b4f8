#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "command.h"
#include "config/main_process.h"
#include "config/print.h"
#include "configuration.h"
#include "estimate/analysis.h"
#include "estimate/read_timing.h"
#include "estimate/system_of.h"
#include "estimate/text.h"
#include "host/application_wiring.h"
#include "loading/component_library.h"
#include "loading/library_imports.h"
#include "loading/pinned_libraries.h"
#include "option_values.h"
#include "print.h"
#include "processes/process_plan.h"

namespace fastcycle::tool {
namespace {

struct CheckOptions {
  Configuration configuration;
  bool print = false;
  bool print_pins = false;
  std::vector<std::filesystem::path> timing;
  double margin = 1.2;
  double wake_us = 200;
  unsigned cpus = 0;
  bool json = false;
};

/// Whether the chains can hold, from how long callbacks take.
int estimate(const CheckOptions& options) {
  config::Problems problems;
  estimate::Timing timing;
  for (const std::filesystem::path& file : options.timing) {
    estimate::read_timing(file, options.margin, timing, problems);
  }
  const std::string file = options.configuration.load.file.string();
  if (!may_start(problems, file)) {
    return kWrong;
  }
  const std::unique_ptr<host::Application> application = options.configuration.make_unstarted();
  if (!application) {
    return kWrong;
  }
  const estimate::Machine machine{.cpus = options.cpus,
                                  .wake_up = std::chrono::ceil<Duration>(
                                      std::chrono::duration<double, std::micro>(options.wake_us))};
  const estimate::System system = estimate::system_of(*application, timing, machine, problems);
  if (!may_start(problems, file)) {
    return kWrong;
  }
  const estimate::Estimate result = estimate::analyze(system);
  if (options.json) {
    print_to(stdout, "{}\n", base::printable_json(estimate::to_json(system, result)));
  } else {
    print_text(stdout, estimate::to_text(system, result));
    if (system.chains.empty()) {
      print_text(stdout, "the application has no \"chains\" whose age could be bounded\n");
    }
  }
  const bool all_hold = std::ranges::all_of(
      result.chains, [](const auto& chain) { return chain.verdict == estimate::Verdict::kHolds; });
  const int flushed = flush_output();
  return flushed != kDone ? flushed : all_hold ? kDone : kProblems;
}

/// ", in 2 processes: main, sensing"; nothing if none is named.
std::string processes_text(const config::ApplicationDescription& description) {
  if (description.processes.empty()) {
    return {};
  }
  std::vector<std::string> names;
  const bool has_main = std::ranges::any_of(
      description.components, [](const auto& component) { return component.process.empty(); });
  if (has_main) {
    names.emplace_back(config::kMainProcess);
  }
  for (const config::ProcessDescription& process : description.processes) {
    names.push_back(process.name + (process.has_standby ? " (with a standby)" : ""));
  }
  constexpr std::size_t kMaxShown = 16;
  const std::size_t shown = std::min(names.size(), kMaxShown);
  return fmt::format(
      ", in {} {}: {}{}", names.size(), names.size() == 1 ? "process" : "processes",
      fmt::join(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
      shown < names.size() ? ", …" : "");
}

/// Prints the pins of the application's libraries as they are now. Returns an error message; empty
/// on success.
std::string print_pins(const config::ApplicationDescription& description,
                       const host::LibraryLoader& libraries) {
  std::vector<std::string> names;
  for (const config::ComponentDescription& component : description.components) {
    names.push_back(component.library);
  }
  for (const config::ShadowDescription& shadow : description.shadows) {
    if (!shadow.library.empty()) {
      names.push_back(shadow.library);
    }
  }
  std::map<std::string, std::filesystem::path> files;
  for (const std::string& name : names) {
    const std::filesystem::path file = libraries.file_of(name);
    files[name] = file;
    for (const host::NeededLibrary& needed : host::needed_libraries(file)) {
      files[needed.name] = needed.file;
    }
  }
  nlohmann::ordered_json pins = nlohmann::ordered_json::object();
  for (const auto& [name, file] : files) {
    pins[name] = host::sha256_of(file);
    if (pins[name] == "") {
      return fmt::format("{}: {}", file.string(), std::strerror(errno));
    }
  }
  print_to(stdout, "{}\n",
           nlohmann::ordered_json{{"libraries", {{"sha256", std::move(pins)}}}}.dump(2));
  return {};
}

/// Adds why the application cannot run in its processes.
void check_processes(const config::ApplicationDescription& description,
                     const host::TrialResult& tried, config::Problems& problems) {
  if (problems.has_errors() || (description.processes.empty() && description.shadows.empty())) {
    return;
  }
  const processes::ProcessPlan plan(description, host::wiring_from_text(tried.wiring), {});
  if (plan.problem()) {
    problems.add(config::make_error({}, *plan.problem()));
  }
}

int check(const CheckOptions& options) {
  if (!options.timing.empty()) {
    return estimate(options);
  }
  config::Problems problems;
  host::TrialResult tried;
  const config::ApplicationDescription description = options.configuration.read(
      host::ConstructorFault::kError, problems, Configuration::TrialWarnings::kReported, &tried);
  check_processes(description, tried, problems);
  const host::LibraryLoader libraries(
      host::library_folders(description, options.configuration.library_path));
  host::warn_of_imports(description, libraries, problems);
  if (options.print && !description.effective.is_null()) {
    print_to(stdout, "{}\n", base::printable_json(config::print(description.effective)));
  }
  const std::string file = options.configuration.load.file.string();
  if (!may_start(problems, file)) {
    return kWrong;
  }
  if (options.print_pins) {
    if (const std::string obstacle = print_pins(description, libraries); !obstacle.empty()) {
      print_to(stderr, "fastcycle check: {}\n", obstacle);
      return kWrong;
    }
  }
  const std::size_t count = description.components.size();
  print_to(options.print || options.print_pins ? stderr : stdout, "{}; {} {}{}\n",
           summary(problems, file), count,
           count == 1 ? "component is right" : "components fit together",
           processes_text(description));
  return flush_output();
}

}  // namespace

Command add_check(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "check", "Report all errors in an application's files and components, without starting it");
  line->footer(examples(
      "  fastcycle check app.json\n"
      "  fastcycle check app.json --overlay vehicle_17.json --print\n"
      "  fastcycle check app.json --print-pins >pins.json; fastcycle run app.json --overlay "
      "pins.json\n"
      "  fastcycle check app.json --timing times.json   do the latency chains hold?\n"
      "  fastcycle run app.json --report r.json; fastcycle check app.json --timing r.json\n"));
  const auto options = std::make_shared<CheckOptions>();
  options->configuration.add_to(*line);
  line->add_flag("--print", options->print,
                 "Print the effective configuration and the source of each value");
  line->add_flag("--print-pins", options->print_pins,
                 "Print an overlay that pins the libraries: only these, unchanged, may be loaded")
      ->excludes("--print");
  const auto when_timed = [line](CLI::Option* option) {
    return option->needs(line->get_option("--timing"));
  };
  line->add_option("--timing", options->timing,
                   "Estimate whether the \"chains\" meet their deadlines, from callback durations: "
                   "a file of them, or the report of a run. Repeatable; exit code 3 if one chain "
                   "is not shown to hold")
      ->allow_extra_args(false)
      ->type_name("FILE");
  when_timed(line->add_option("--margin", options->margin,
                              "Factor for the longest callback durations of a report (1.2)")
                 ->type_name("FACTOR")
                 ->check(is_number_from(1.0, 100.0)));
  when_timed(line->add_option("--wake-us", options->wake_us,
                              "Maximum wake-up latency of a worker, in microseconds (200)")
                 ->type_name("US")
                 ->check(is_number_from(0.0, 1e6)));
  when_timed(line->add_option("--cpus", options->cpus,
                              "Number of CPUs of the target machine (those of this one)")
                 ->type_name("N")
                 ->check(is_number_from(1, 1024)));
  when_timed(line->add_flag("--json", options->json, "Print the estimate as one JSON document"));
  return {line, [options] { return check(*options); }};
}

}  // namespace fastcycle::tool

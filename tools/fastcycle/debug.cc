#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "base/clock.h"
#include "command.h"
#include "config/nearest.h"
#include "duration.h"
#include "exact_replaying.h"
#include "file_work.h"
#include "mcap/error.h"
#include "option_values.h"
#include "print.h"
#include "record/recording_reader.h"

namespace fastcycle::tool {
namespace {

struct DebugOptions {
  ExactReplaying replaying;
  std::uint64_t activation = 0;
  std::string at;
  std::vector<std::string> commands;
  bool is_batch = false;
};

/// The number of the first activation of `component` at `since` of the run or later; none, and why
/// not printed, if there is none.
std::optional<std::uint64_t> find_activation(const DebugOptions& options,
                                             const std::string& component) {
  const auto schedule = record::RecordedSchedule::read(options.replaying.files);
  const auto* recorded = schedule.find(component);
  if (recorded == nullptr) {
    std::vector<std::string> known;
    for (const auto& one : schedule.components) {
      known.push_back(one.name);
    }
    const std::string hint = config::did_you_mean(config::nearest(component, known));
    print_error("debug", "the log contains no component \"" + component + "\"" +
                             (hint.empty() ? hint : "; " + hint));
    return std::nullopt;
  }
  const auto& all = recorded->activations;
  if (all.empty()) {
    print_error("debug", "the log contains no activation of \"" + component + "\"");
    return std::nullopt;
  }
  if (options.at.empty()) {
    const auto found =
        std::ranges::find(all, options.activation, &record::RecordedActivation::number);
    if (found == all.end()) {
      print_error("debug",
                  fmt::format("component \"{}\" has the activations {} to {}, not {}", component,
                              all.front().number, all.back().number, options.activation));
      return std::nullopt;
    }
    return found->number;
  }
  const record::RecordingReader reader(options.replaying.files);
  const std::int64_t time_ns = base::to_ns(reader.begin() + *parse_duration(options.at));
  const auto found =
      std::ranges::lower_bound(all, time_ns, {}, &record::RecordedActivation::time_ns);
  if (found == all.end()) {
    print_error("debug",
                "component \"" + component + "\" has no activation at " + options.at + " or later");
    return std::nullopt;
  }
  return found->number;
}

std::vector<std::string> words_for_gdb(const DebugOptions& options, std::uint64_t activation) {
  std::vector<std::string> words = {"gdb", "--quiet"};
  if (options.is_batch) {
    words.emplace_back("--batch");
  }
  for (const char* command :
       {"set breakpoint pending on", "set print object on", "set confirm off",
        "handle SIGUSR1 nostop noprint pass", "break fastcycle_before_activation", "run"}) {
    words.emplace_back("-ex");
    words.emplace_back(command);
  }
  for (const std::string& command : options.commands) {
    words.emplace_back("-ex");
    words.push_back(command);
  }
  words.insert(words.end(),
               {"--args", std::filesystem::read_symlink("/proc/self/exe").string(), "verify"});
  for (const std::filesystem::path& file : options.replaying.files) {
    words.push_back(file.string());
  }
  const Configuration& configuration = options.replaying.configuration;
  if (!configuration.load.file.empty()) {
    words.push_back(configuration.load.file.string());
  }
  const auto add = [&words](const char* name, const auto& values) {
    for (const auto& value : values) {
      words.emplace_back(name);
      words.push_back(std::filesystem::path(value).string());
    }
  };
  add("--set", configuration.load.sets);
  add("--var", configuration.load.variables);
  add("--overlay", configuration.load.overlays);
  add("--isolate", configuration.load.isolated);
  add("--library-path", configuration.library_path);
  add("--component", options.replaying.options.components);
  if (!options.replaying.start.empty()) {
    words.insert(words.end(), {"--start", options.replaying.start});
  }
  words.insert(words.end(), {"--workers", "1", "--stop-before", std::to_string(activation)});
  return words;
}

/// Whether `execvp` would find this program.
bool is_there(const std::string& program) {
  const char* const folders = std::getenv("PATH");
  std::istringstream rest(folders == nullptr ? "/bin:/usr/bin" : folders);
  for (std::string folder; std::getline(rest, folder, ':');) {
    if (::access(((folder.empty() ? "." : folder) + "/" + program).c_str(), X_OK) == 0) {
      return true;
    }
  }
  return false;
}

int debug(DebugOptions& options) {
  if (const std::string wrong = options.replaying.find_wrong(); !wrong.empty()) {
    return print_error("debug", wrong);
  }
  const auto& components = options.replaying.options.components;
  if (components.size() != 1) {
    return print_error("debug", "expects one component: --component NAME");
  }
  if ((options.activation == 0) == options.at.empty()) {
    return print_error("debug", "expects --activation N, or --at TIME");
  }
  if (!is_there("gdb")) {
    return print_error("debug", "gdb is not installed; apt install gdb");
  }
  std::optional<std::uint64_t> activation;
  try {
    activation = find_activation(options, components.front());
  } catch (const mcap::Error& error) {
    return print_error("debug", error.what());
  }
  if (!activation) {
    return kWrong;
  }
  std::vector<std::string> words = words_for_gdb(options, *activation);
  std::vector<char*> arguments;
  for (std::string& word : words) {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  if (!options.is_batch) {
    print_to(stderr,
             "gdb stops before activation {} of \"{}\": print *object shows the component, break "
             "and continue go on from there\n",
             *activation, components.front());
  }
  execvp(arguments.front(), arguments.data());
  return print_error("debug", std::string("gdb cannot be started: ") + std::strerror(errno));
}

}  // namespace

Command add_debug(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("debug", "Re-execute a log up to an activation and stop there in gdb");
  line->footer(examples(
      "  fastcycle debug drive.mcap --component motion_planning --activation 1234\n"
      "  fastcycle debug drive.mcap app.json --component control --at 12.3s\n"
      "  fastcycle debug drive.mcap --component control --at 5s --batch --ex 'print *object'\n"
      "\n"
      "The log is executed again up to that activation; then gdb stops the process, with the\n"
      "component in the variable `object`. Each execution is identical.\n"
      "See `fastcycle verify`.\n"));
  const auto options = std::make_shared<DebugOptions>();
  options->replaying.add_to(*line);
  line->add_option("--activation", options->activation,
                   "Number of the activation, as verify and echo print it")
      ->type_name("N");
  line->add_option("--at", options->at, "First activation at or after this time of the run")
      ->type_name("TIME")
      ->check(is_time());
  line->add_option("--ex", options->commands, "gdb command to execute after the stop (repeatable)")
      ->allow_extra_args(false)
      ->type_name("COMMAND");
  line->add_flag("--batch", options->is_batch, "Exit gdb after these commands");
  return {line, [options] { return debug(*options); }};
}

}  // namespace fastcycle::tool

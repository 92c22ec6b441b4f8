#include "exact_replaying.h"

#include <algorithm>
#include <charconv>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "command.h"
#include "option_values.h"
#include "print.h"
#include "record/recording_reader.h"
#include "replay/recorded_driver.h"
#include "rewriting.h"

namespace fastcycle::tool {
namespace {

/// The builds of libraries that are not those of the recorded run, among those that both have.
std::vector<std::string> other_builds(const std::map<std::string, std::string>& then,
                                      const std::map<std::string, std::string>& now) {
  std::vector<std::string> names;
  constexpr std::string_view kPrefix = "build_id.";
  for (const auto& [key, id] : then) {
    const auto found = now.find(key);
    if (key.starts_with(kPrefix) && found != now.end() && found->second != id) {
      names.push_back(key.substr(kPrefix.size()));
    }
  }
  return names;
}

/// Suppresses the components' output, and limits of their calls, during re-execution.
void silence(config::ApplicationDescription& description) {
  description.log_level = LogLevel::kError;
  for (config::ComponentDescription& component : description.components) {
    component.log_level.reset();
    component.hang = {.callback_limit = {}, .lifecycle_limit = {}};  // The machine may be slower.
  }
}

}  // namespace

void ExactReplaying::add_to(CLI::App& line) {
  line.add_option("logs", files,
                  "The files of one log, then the application's JSON file (that in the log)")
      ->required()
      ->type_name("FILE.mcap [APP.json]");
  configuration.add_to(line);
  line.remove_option(line.get_option("application"));
  line.add_option("--component", options.components,
                  "Execute only this component (all whose inputs are in the log); repeatable")
      ->allow_extra_args(false)
      ->type_name("NAME");
  line.add_option("--workers", workers,
                  "Number of threads (that of CPUs); the result does not depend on it")
      ->type_name("N");
  line.add_option("--start", start,
                  "Start time, from the beginning of the run: 8s. Each component begins at its "
                  "last key frame before; one that declares no state, at the beginning of the log")
      ->type_name("TIME");
}

void ExactReplaying::add_input_to(CLI::App& line) {
  line.add_option(
          "--continue-with", input,
          "Input from other executed components: their recorded messages, or their new ones")
      ->type_name("recorded|new")
      ->check(is_one_of({"recorded", "new"}));
}

std::string ExactReplaying::find_wrong() {
  if (!files.empty() && files.back().extension() == ".json") {
    configuration.load.file = files.back();
    files.pop_back();
  }
  if (files.empty()) {
    return "expects a log: drive.mcap, or drive.mcap app.json";
  }
  if (const std::string twice = record::find_named_twice(files); !twice.empty()) {
    return twice;
  }
  options.files = files;
  options.input = input == "new" ? host::ExactReplayOptions::Input::kNew
                                 : host::ExactReplayOptions::Input::kRecorded;
  options.workers = std::max(1U, std::min(kMaxWorkers, std::thread::hardware_concurrency()));
  if (!start.empty()) {
    std::optional<std::uint64_t> start_ns;
    if (std::string wrong = read_offset("--start", start, start_ns); !wrong.empty()) {
      return wrong;
    }
    options.start = Duration(static_cast<std::int64_t>(start_ns.value_or(0)));
  }
  if (!workers.empty()) {
    const char* const end = workers.data() + workers.size();
    const auto [last, error] = std::from_chars(workers.data(), end, options.workers);
    if (error != std::errc() || last != end || options.workers == 0 ||
        options.workers > kMaxWorkers) {
      return fmt::format("--workers expects a number from 1 to {}, not \"{}\"", kMaxWorkers,
                         workers);
    }
  }
  return {};
}

ReplayedApplication::~ReplayedApplication() {
  replay_.reset();
  if (application_ != nullptr) {
    application_->stop();  // While its observer lives.
  }
  diagnosis_.reset();
  application_.reset();
}

std::unique_ptr<ReplayedApplication> ReplayedApplication::make(const std::string& command,
                                                               ExactReplaying& replaying) {
  std::unique_ptr<ReplayedApplication> made(new ReplayedApplication);
  made->schedule_ = record::RecordedSchedule::read(replaying.files);
  const record::RecordedSchedule& schedule = made->schedule_;
  for (const std::string& note : schedule.notes) {
    print_to(stderr, "{}\n", note);
  }
  Configuration& configuration = replaying.configuration;
  if (configuration.load.file.empty()) {
    if (schedule.application.empty()) {
      print_to(stderr,
               "fastcycle {}: the log does not contain its application; give its JSON file\n",
               command);
      return nullptr;
    }
    const auto file = schedule.facts.find("file");
    configuration.load.file =
        file == schedule.facts.end() ? std::string("application.json") : file->second;
    configuration.load.text = schedule.application;
  }
  const std::string file = configuration.load.file.string();
  config::Problems problems;
  host::TrialResult tried;
  const config::ApplicationDescription description = configuration.read(
      host::ConstructorFault::kFault, problems, Configuration::TrialWarnings::kLeftOut, &tried);
  if (!may_start(problems, file)) {
    return nullptr;
  }
  const auto changes_messages = [](const config::FaultDescription& fault) {
    return fault.kind == config::FaultKind::kFreeze || fault.kind == config::FaultKind::kCorrupt;
  };
  if (std::ranges::any_of(description.faults.list, changes_messages)) {
    print_to(stderr,
             "warning: faults froze or corrupted messages in this run; the log contains the "
             "published messages, so their receivers may differ\n");
  }
  config::ApplicationDescription silent = description;
  silence(silent);
  silent.chains.clear();  // Nothing is late when time comes from the log.
  silent.record.reset();
  silent.flight_recorder.reset();
  made->libraries_ = std::make_unique<host::LibraryLoader>(
      host::library_folders(description, configuration.library_path), description.libraries);
  made->libraries_->expect(tried.files);
  const record::RecordingReader reader(replaying.files);
  made->stand_ins_ = std::make_unique<host::StandIns>(*made->libraries_, silent, reader.streams());
  auto driver = std::make_unique<host::RecordedDriver>();
  host::RecordedDriver& recorded = *driver;
  made->application_ =
      std::make_unique<host::Application>(std::move(driver), made->stand_ins_->description());
  host::Application& application = *made->application_;
  application.own_topics_are_free = true;
  application.declare_stand_in = [&stand_ins = *made->stand_ins_](auto& core) {
    stand_ins.declare(core);
  };
  made->diagnosis_ = std::make_unique<host::Diagnosis>(application, std::filesystem::path());
  application.add(*made->diagnosis_);
  config::Problems found;
  application.build(*made->stand_ins_, found, host::ConstructorFault::kFault);
  if (found.has_errors()) {
    static_cast<void>(may_start(found, file));
    return nullptr;
  }
  for (const std::string& name : other_builds(schedule.facts, application.explanation().facts)) {
    print_to(stderr, "warning: {} is not the build that was recorded\n", name);
  }
  config::Problems wrong;
  made->replay_ = std::make_unique<host::ExactReplay>(application, recorded, schedule,
                                                      replaying.options, wrong);
  print(wrong);
  return wrong.has_errors() ? nullptr : std::move(made);
}

}  // namespace fastcycle::tool

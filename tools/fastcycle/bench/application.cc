#include "bench/application.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <variant>

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "config/load.h"
#include "config/problem.h"
#include "loading/component_library.h"
#include "measure/clock.h"
#include "measure/floors.h"

namespace fastcycle::tool::bench {
namespace {

/// The last CPUs that this process may use; the first is the machine's own.
int cpu_of(int place) {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  sched_getaffinity(0, sizeof(cpus), &cpus);
  int left = place;
  for (int cpu = CPU_SETSIZE - 1; cpu >= 0; --cpu) {
    if (CPU_ISSET(cpu, &cpus) && left-- == 0) {
      return cpu;
    }
  }
  return 0;
}

[[noreturn]] void refuse(const config::Problems& problems) {
  std::string text;
  for (const config::Problem& problem : problems.all()) {
    if (problem.warning) {
      continue;  // A consequence of an error.
    }
    text += (text.empty() ? "" : "\n") + config::to_string(problem);
  }
  throw std::runtime_error(text);
}

std::filesystem::path write_application(const Json& json, const std::string& folder) {
  std::filesystem::path file = folder + "/benchmark.json";
  std::ofstream stream(file);
  stream << json.dump(2);
  stream.close();
  if (!stream) {
    throw std::runtime_error("bench: " + file.string() + " could not be written: " +
                             std::strerror(errno) + "; TMPDIR says where");
  }
  return file;
}

std::string text_of(const std::filesystem::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The failure that a component or the application reports; empty if it ended well.
std::string find_failure(const host::Application& application) {
  for (const auto& component : application.components()) {
    if (!component->faults.empty()) {
      return "component \"" + component->name + "\" failed: " + component->faults.front();
    }
    const auto trouble = component->results.find("trouble");
    if (trouble != component->results.end()) {
      if (const auto* text = std::get_if<std::string>(&trouble->second); !text->empty()) {
        return *text;
      }
    }
  }
  return {};
}

}  // namespace

Json executor(const Options& options, const std::string& name, const std::string& wait, int place) {
  Json json = {{"name", name}, {"threads", 1}, {"wait", wait}};
  if (options.is_fifo) {
    json["policy"] = "fifo";
    json["priority"] = measure::kFifoPriority;
    if (wait == "spin") {
      json["cpus"] = {cpu_of(place)};
    }
  }
  return json;
}

Json component(const std::string& name, const std::string& library, const std::string& executor,
               Json params) {
  return {
      {"name", name}, {"library", library}, {"executor", executor}, {"params", std::move(params)}};
}

Json application(Json executors, Json components) {
  return {{"name", "benchmark"},
          {"executors", std::move(executors)},
          {"components", std::move(components)}};
}

Json source(const Options& options, std::int64_t size) {
  return component("source", "benchmark_source", "publisher",
                   {{"size_bytes", size},
                    {"count", options.count},
                    {"warmup", options.warmup},
                    {"interval_us", options.interval_us}});
}

Json sink(const Options& options, const std::string& name, std::int64_t size) {
  Json json = component(name, "benchmark_sink", "subscriber",
                        {{"expected", options.warmup + options.count}});
  json["subscribers"]["payload"]["depth"] = depth_for(size);
  return json;
}

void write_samples_to(Json& component, const std::string& folder) {
  if (!folder.empty()) {
    component["params"]["samples"] = folder + "/" + component["name"].get<std::string>();
  }
}

double Finished::number(const std::string& component, const std::string& name) const {
  const auto& its_results = results.at(component);
  if (const auto found = its_results.find(name); found != its_results.end()) {
    if (const auto* real = std::get_if<double>(&found->second)) {
      return *real;
    }
    if (const auto* whole = std::get_if<std::int64_t>(&found->second)) {
      return static_cast<double>(*whole);
    }
  }
  throw std::runtime_error("the benchmark's component \"" + component + "\" did not report \"" +
                           name + "\"");
}

std::int64_t Finished::whole(const std::string& component, const std::string& name) const {
  const auto& its_results = results.at(component);
  if (const auto found = its_results.find(name); found != its_results.end()) {
    return std::get<std::int64_t>(found->second);
  }
  throw std::runtime_error("the benchmark's component \"" + component + "\" did not report \"" +
                           name + "\"");
}

measure::Usage Finished::usage(const std::string& component) const {
  return {.cpu_us = number(component, "cpu_us"),
          .minor_faults = whole(component, "minor_faults"),
          .major_faults = whole(component, "major_faults"),
          .voluntary_switches = whole(component, "voluntary_switches"),
          .involuntary_switches = whole(component, "involuntary_switches")};
}

std::int64_t Finished::sum(const std::string& name) const {
  std::int64_t total = 0;
  for (const auto& [component, its_results] : results) {
    if (its_results.contains(name)) {
      total += whole(component, name);
    }
  }
  return total;
}

/// The application that `request_end` ends, as long as it lives.
class Runner::Announcement {
 public:
  Announcement(Runner& runner, host::Application& application) : runner_(runner) {
    const std::lock_guard lock(runner_.mutex_);
    runner_.running_ = &application;
    if (runner_.is_ended_) {
      application.request_end(host::EndReason::kRequested);
    }
  }
  Announcement(const Announcement&) = delete;
  Announcement& operator=(const Announcement&) = delete;
  ~Announcement() {
    const std::lock_guard lock(runner_.mutex_);
    runner_.running_ = nullptr;
  }

 private:
  Runner& runner_;
};

Finished Runner::run(const Json& json, const std::string& folder, const RunHooks& hooks) {
  Finished finished;
  const std::filesystem::path file = write_application(json, folder);
  finished.stages.begin_ns = measure::now_ns();
  config::Problems problems;
  const config::ApplicationDescription description = config::load({.file = file}, problems);
  if (problems.has_errors()) {
    refuse(problems);
  }
  finished.stages.read_ns = measure::now_ns();
  host::LibraryLoader libraries(host::library_folders(description, {}));
  std::optional<trace::Tracer> tracer;  // Outlives what it looks at.
  host::Application application(description, hooks.clock);
  if (description.record) {
    application.record(*description.record);
  }
  if (description.trace) {
    application.add(tracer.emplace(*description.trace));
  }
  if (hooks.before_build) {
    hooks.before_build(application);
  }
  application.build(libraries, problems, host::ConstructorFault::kError);
  if (problems.has_errors()) {
    refuse(problems);
  }
  finished.stages.built_ns = measure::now_ns();
  const Announcement announcement(*this, application);
  finished.refusals = application.start();
  finished.stages.started_ns = measure::now_ns();
  if (hooks.after_start) {
    hooks.after_start();
  }
  application.run(hooks.limit);
  if (hooks.before_stop) {
    hooks.before_stop();
  }
  application.stop();
  finished.stages.stopped_ns = measure::now_ns();

  if (const std::string failure = find_failure(application); !failure.empty()) {
    throw std::runtime_error(failure);
  }
  finished.report = host::make_report(
      application, std::chrono::nanoseconds(measure::now_ns() - finished.stages.started_ns));
  if (tracer) {
    finished.trace = tracer->report();
  }
  for (const auto& component : application.components()) {
    finished.results[component->name] = component->results;
  }
  if (!hooks.clock.is_simulated) {
    finished.clock_offset_ns = base::to_ns(application.clock().at_monotonic(0));
  }
  return finished;
}

Json run_program(const Json& json, const std::string& folder) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  const std::string report = folder + "/report.json";
  const std::string output = folder + "/output.txt";
  std::array<std::string, 6> words{program,   "run",      write_application(json, folder).string(),
                                   "--quiet", "--report", report};
  std::array<char*, words.size() + 1> pointers{};
  std::ranges::transform(words, pointers.begin(), [](std::string& word) { return word.data(); });
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t process = 0;
  const int error =
      posix_spawn(&process, program.c_str(), &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    throw std::system_error(error, std::generic_category(), "bench: " + program);
  }
  int status = 0;
  while (waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  if (status != 0) {
    const std::string said = text_of(output);
    throw std::runtime_error(fmt::format(
        "bench: fastcycle run {} ended with {} {}:\n{}", words[2],
        WIFSIGNALED(status) ? "signal" : "exit code",
        WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status),
        said.empty()
            ? "it printed nothing; check the free space in " + folder + "? TMPDIR says where"
            : said));
  }
  return Json::parse(text_of(report));
}

void Runner::request_end() {
  const std::lock_guard lock(mutex_);
  is_ended_ = true;
  if (running_ != nullptr) {
    running_->request_end(host::EndReason::kRequested);
  }
}

}  // namespace fastcycle::tool::bench

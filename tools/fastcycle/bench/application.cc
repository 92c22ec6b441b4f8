#include "bench/application.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <utility>

#include <nlohmann/json.hpp>

#include "config/load.h"
#include "config/problem.h"
#include "host/application.h"
#include "host/component_library.h"

namespace fastcycle::tool::bench {
namespace {

using Json = nlohmann::ordered_json;

Json executor(const std::string& name, const Profile& profile) {
  Json json = {{"name", name}, {"threads", 1}, {"wait", profile.wait}};
  if (profile.is_fifo) {
    json["policy"] = "fifo";
    json["priority"] = 80;
  }
  return json;
}

/// A publisher and a subscriber on two executors, and where the stamps go.
Json two_executors(const measure::Plan& plan, const Profile& profile) {
  Json source = {{"name", "source"},
                 {"library", "benchmark_source"},
                 {"executor", "publisher"},
                 {"params",
                  {{"size_bytes", plan.size},
                   {"count", plan.count},
                   {"warmup", plan.warmup},
                   {"interval_us", plan.interval_us}}}};
  Json sink = {{"name", "sink"},
               {"library", "benchmark_sink"},
               {"executor", "subscriber"},
               {"params", {{"expected", plan.warmup + plan.count}}}};
  return {{"name", "benchmark"},
          {"executors", {executor("publisher", profile), executor("subscriber", profile)}},
          {"components", {std::move(source), std::move(sink)}}};
}

[[noreturn]] void refuse(const config::Problems& problems) {
  std::string text;
  for (const config::Problem& problem : problems.all()) {
    text += (text.empty() ? "" : "\n") + config::to_string(problem);
  }
  throw std::runtime_error(text);
}

}  // namespace

std::string latency_application(const measure::Plan& plan, const Profile& profile,
                                const std::string& folder) {
  Json json = two_executors(plan, profile);
  json["components"][1]["params"]["samples"] = folder + "/samples";
  return json.dump(2);
}

std::string rtt_application(const measure::Plan& plan, const Profile& profile,
                            const std::string& folder) {
  Json json = two_executors(plan, profile);
  json["components"][0]["params"]["takes_echo"] = true;
  json["components"][0]["params"]["samples"] = folder + "/samples";
  json["components"][1]["params"]["echoes"] = true;
  return json.dump(2);
}

host::RunReport run_application(const std::string& text, const std::string& folder) {
  const std::filesystem::path file = folder + "/benchmark.json";
  std::ofstream(file) << text;
  config::Problems problems;
  const config::ApplicationDescription description = config::load({.file = file}, problems);
  if (problems.has_errors()) {
    refuse(problems);
  }
  host::LibraryLoader libraries(host::library_folders(description, {}));
  host::Application application(description, {});
  application.build(libraries, problems, host::ConstructorFault::kMistake);
  if (problems.has_errors()) {
    refuse(problems);
  }
  const auto began = std::chrono::steady_clock::now();
  application.start();
  application.run(std::nullopt);
  application.stop();
  return host::make_report(application, std::chrono::steady_clock::now() - began);
}

}  // namespace fastcycle::tool::bench

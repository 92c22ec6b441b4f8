#include "host/recording.h"

#include <algorithm>
#include <exception>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "broker/topics.h"
#include "component/component_core.h"
#include "component/component_host.h"
#include "config/nearest.h"
#include "mcap/topic_filter.h"

namespace fastcycle::host {
namespace {

mcap::Compression to_mcap(config::Compression compression) {
  switch (compression) {
    case config::Compression::kNone:
      return mcap::Compression::kNone;
    case config::Compression::kLz4:
      return mcap::Compression::kLz4;
    case config::Compression::kZstd:
      break;
  }
  return mcap::Compression::kZstd;
}

void check_patterns(const std::string& who, const std::vector<std::string>& patterns,
                    const config::Place& place, const detail::Topics& topics,
                    config::Problems& problems) {
  std::vector<std::string> names;
  for (const auto& [name, topic] : topics.all()) {
    names.push_back(name);
  }
  for (const std::string& pattern : patterns) {
    if (std::ranges::any_of(names,
                            [&](const auto& name) { return mcap::matches(pattern, name); })) {
      continue;
    }
    config::Problem problem =
        config::make_error(place, "the " + who + "'s pattern \"" + pattern + "\" means no topic",
                           config::did_you_mean(config::nearest(pattern, names)));
    problem.warning = true;
    problems.add(std::move(problem));
  }
}

}  // namespace

record::RecorderOptions recorder_options(const config::RecordDescription& description) {
  record::RecorderOptions options;
  options.recording.file = description.file;
  options.recording.splitting = {.bytes = description.split_bytes, .time = description.split_time};
  options.recording.sync_interval = description.sync_interval;
  options.filter = {.topics = description.topics, .except = description.except};
  options.chunk.compression = to_mcap(description.compression);
  for (const auto& [pattern, compression] : description.compression_by_topic) {
    options.rules.push_back({.pattern = pattern, .chunk = {.compression = to_mcap(compression)}});
  }
  options.memory_bytes = description.memory_bytes;
  options.records_activations = description.has_activations;
  options.is_background = description.is_background;
  return options;
}

void check_patterns(const config::RecordDescription& description, const detail::Topics& topics,
                    config::Problems& problems) {
  std::vector<std::string> patterns = description.topics;
  patterns.insert(patterns.end(), description.except.begin(), description.except.end());
  for (const auto& [pattern, compression] : description.compression_by_topic) {
    patterns.push_back(pattern);
  }
  check_patterns("recorder", patterns, description.place, topics, problems);
}

record::FlightOptions flight_options(const config::FlightRecorderDescription& description,
                                     const std::string& application) {
  return {.file = description.file.empty() ? std::filesystem::path(application + ".ring")
                                           : description.file,
          .bytes = description.bytes,
          .before = description.before,
          .after = description.after,
          .filter = {.topics = description.topics, .except = description.except}};
}

void check_patterns(const config::FlightRecorderDescription& description,
                    const detail::Topics& topics, config::Problems& problems) {
  std::vector<std::string> patterns = description.topics;
  patterns.insert(patterns.end(), description.except.begin(), description.except.end());
  check_patterns("flight recorder", patterns, description.place, topics, problems);
}

RecorderObserver::RecorderObserver(const config::RecordDescription& description,
                                   const base::Clock& clock, detail::LogSource& log, RunFacts facts)
    : facts_(std::move(facts)),
      has_activations_(description.has_activations),
      recorder_(recorder_options(description), clock) {
  recorder_.on_trouble = [&log](const std::string& text) {
    log.write(LogLevel::kError, "recorder", text);
  };
}

void RecorderObserver::start(const ObserverView& view, std::vector<base::Refusal>& refusals) {
  if (!recorder_.start(facts_.at_start(),
                       {.rings = view.rings, .reads = view.reads, .peers = view.peers})) {
    refusals.push_back(
        {.what = "recording: " + recorder_.problem(),
         .remedy = "what is published is lost and counted; a file is tried again every second"});
  }
}

void RecorderObserver::stop(const Application&) {
  recorder_.stop(facts_.at_end());
}

FlightObserver::FlightObserver(const config::FlightRecorderDescription& description,
                               const std::string& application, const base::Clock& clock,
                               detail::LogSource& log, std::function<record::Explanation()> explain)
    : explain_(std::move(explain)),
      description_(description),
      recorder_(flight_options(description, application), clock) {
  recorder_.on_news = [&log](bool is_trouble, const std::string& text) {
    log.write(is_trouble ? LogLevel::kError : LogLevel::kInfo, "flight recorder", text);
  };
}

void FlightObserver::open(config::Problems& problems) {
  try {
    recorder_.open(explain_());
  } catch (const std::exception& error) {  // Also those of the file system.
    problems.add(
        config::make_error(description_.place, std::string("flight recorder: ") + error.what()));
  }
}

void FlightObserver::start(const ObserverView& view, std::vector<base::Refusal>&) {
  recorder_.start({.rings = view.rings, .reads = view.reads, .peers = view.peers});
}

void FlightObserver::faulted(std::string_view component, std::string_view what) noexcept {
  if (description_.on_fault) {
    dump("fault", component, what);
  }
}

void FlightObserver::stop(const Application&) {
  recorder_.stop();
}

void record_for(detail::ComponentCore& component, const config::RecordDescription& description) {
  if (component.is_redeclaring) {
    return;  // Reconstructed after a fault: the recording continues.
  }
  if (component.application.is_recorded()) {
    component.problems->add(
        config::make_error(component.description.place,
                           "component \"" + component.name +
                               "\" records what is recorded already: by \"record\", "
                               "--record or another component",
                           "leave one of them out"));
    return;
  }
  component.is_recorder = true;
  component.application.record(description);
}

}  // namespace fastcycle::host

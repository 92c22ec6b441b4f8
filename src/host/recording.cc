#include "host/recording.h"

#include <algorithm>
#include <string>
#include <vector>

#include "broker/topics.h"
#include "config/nearest.h"
#include "host/application.h"
#include "host/component_core.h"
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
  return options;
}

void check_patterns(const config::RecordDescription& description, const detail::Topics& topics,
                    config::Problems& problems) {
  std::vector<std::string> names;
  for (const auto& [name, topic] : topics.all()) {
    names.push_back(name);
  }
  const auto check = [&](const std::string& pattern) {
    if (std::ranges::none_of(names,
                             [&](const auto& name) { return mcap::matches(pattern, name); })) {
      config::Problem problem = config::mistake(
          description.place, "the recorder's pattern \"" + pattern + "\" means no topic",
          config::did_you_mean(config::nearest(pattern, names)));
      problem.warning = true;
      problems.add(std::move(problem));
    }
  };
  std::ranges::for_each(description.topics, check);
  std::ranges::for_each(description.except, check);
  for (const auto& [pattern, compression] : description.compression_by_topic) {
    check(pattern);
  }
}

void record_for(detail::ComponentCore& component, const config::RecordDescription& description) {
  if (component.is_redeclaring) {
    return;  // Made anew after a fault: the recording goes on.
  }
  if (component.application.recorder() != nullptr) {
    component.problems->add(config::mistake(
        component.description.place, "component \"" + component.name +
                                         "\" records what is recorded already: by \"record\", "
                                         "--record or another component"));
    return;
  }
  component.application.record(description);
}

}  // namespace fastcycle::host

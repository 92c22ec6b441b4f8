#include "estimate/recorded.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "broker/topics.h"
#include "log/log.pb.h"
#include "mcap/file.h"
#include "mcap/reader.h"
#include "record/log_format.h"

namespace fastcycle::estimate {
namespace {

constexpr std::string_view kComponent = "component.";

/// Components by their place in the recorded application.
std::map<std::uint32_t, std::string> components_of(const mcap::Reader& reader) {
  std::map<std::uint32_t, std::string> components;
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    if (index.name != record::kRunMetadata) {
      continue;
    }
    for (const auto& [key, value] : reader.read(index).metadata) {
      std::uint32_t place = 0;
      if (key.starts_with(kComponent) &&
          std::from_chars(key.data() + kComponent.size(), key.data() + key.size(), place).ec ==
              std::errc()) {
        components[place] = value;
      }
    }
  }
  return components;
}

/// Topics by the id of their publishers.
std::map<PublisherId, std::string> topics_of(const mcap::Reader& reader) {
  std::map<PublisherId, std::string> topics;
  for (const auto& [id, channel] : reader.definitions().channels()) {
    const auto& metadata = channel.metadata;
    if (const auto id_text = metadata.find("publisher_id"); id_text != metadata.end()) {
      PublisherId publisher = 0;
      const std::string& text = id_text->second;
      if (std::from_chars(text.data(), text.data() + text.size(), publisher, 16).ec ==
          std::errc()) {
        topics[publisher] = channel.topic;
      }
    } else if (const auto publisher = metadata.find("publisher"); publisher != metadata.end()) {
      topics[detail::publisher_id(publisher->second, channel.topic)] = channel.topic;
    }
  }
  return topics;
}

void read(const std::filesystem::path& file, double margin, Timing& timing,
          config::Problems& problems) {
  const mcap::FileSource source(file);
  const mcap::Reader reader(source);
  const auto components = components_of(reader);
  const auto topics = topics_of(reader);
  const config::Place place{file.string(), 0, {}};
  std::map<std::string, ComponentTiming> found;
  std::uint64_t lost = 0;
  const auto raise = [&](std::optional<Duration>& longest, std::uint64_t duration_ns) {
    const Duration its(static_cast<std::int64_t>(static_cast<double>(duration_ns) * margin));
    longest = std::max(longest.value_or(Duration()), its);
  };
  mcap::MessageReader messages = reader.messages({.topics = {record::kActivationsTopic}});
  while (const auto message = messages.next()) {
    log::Activations activations;
    if (!activations.ParseFromArray(message->data.data(), static_cast<int>(message->data.size()))) {
      problems.add(config::make_error(place, "a record of activations is none"));
      return;
    }
    lost += activations.lost();
    for (const log::Activation& activation : activations.activations()) {
      const auto component = components.find(activation.component());
      if (component == components.end()) {
        continue;
      }
      ComponentTiming& its = found[component->second];
      its.place = place;
      std::string key;
      if (activation.cause() == log::CAUSE_TICK) {
        key = fmt::format("timer {}", activation.key());
      } else if (const auto topic = topics.find(activation.publisher()); topic != topics.end()) {
        key = topic->second;
      } else if (activation.publisher() == 0) {
        continue;  // Of the life cycle and the like.
      }
      // Of topics that were not recorded it is not known which callback it was.
      raise(key.empty() ? its.run_time : its.callbacks[key].run_time, activation.duration_ns());
      if (!key.empty()) {
        its.callbacks[key].place = place;
      }
    }
  }
  if (found.empty()) {
    problems.add(config::make_error(place, "has no activations, whose duration could be taken",
                                    "record with \"activations\": true"));
  }
  if (lost > 0) {
    config::Problem warning = config::make_error(
        place, fmt::format("{} activations were lost, and may have been longer", lost));
    warning.warning = true;
    problems.add(std::move(warning));
  }
  for (auto& [name, component] : found) {
    ComponentTiming& known = timing.components[name];
    known.place = component.place;
    if (component.run_time) {
      known.run_time = component.run_time;
    }
    for (auto& [key, callback] : component.callbacks) {
      known.callbacks[key].run_time = callback.run_time;
      known.callbacks[key].place = callback.place;
    }
  }
}

}  // namespace

void read_recorded_timing(const std::filesystem::path& file, double margin, Timing& timing,
                          config::Problems& problems) {
  try {
    read(file, margin, timing, problems);
  } catch (const mcap::Error& error) {
    problems.add(config::make_error({file.string(), 0, {}}, error.what()));
  }
}

}  // namespace fastcycle::estimate

#include "recording_options.h"

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <ctime>

namespace fastcycle::tool {
namespace {

std::optional<config::Compression> find_compression(const std::string& word) {
  for (const auto compression :
       {config::Compression::kNone, config::Compression::kLz4, config::Compression::kZstd}) {
    if (to_string(compression) == word) {
      return compression;
    }
  }
  return std::nullopt;
}

}  // namespace

std::filesystem::path name_by_time(const std::string& application) {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "_%Y-%m-%d_%H-%M-%S", &utc);
  return application + text.data() + ".mcap";
}

bool RecordingOptions::has_settings() const {
  return !topics.empty() || !except.empty() || !compression.empty() || split_mb || split_s;
}

std::string RecordingOptions::find_wrong() const {
  if (!compression.empty() && !find_compression(compression)) {
    return "a compression is \"none\", \"lz4\" or \"zstd\", not \"" + compression + "\"";
  }
  if (split_mb && !(*split_mb >= 1 && *split_mb <= 1e9)) {
    return "--split-mb expects a number from 1 to 1000000000";
  }
  if (split_s && !(*split_s >= 0.1 && *split_s <= 86'400)) {
    return "--split-s expects a number from 0.1 to 86400";
  }
  return {};
}

std::optional<config::RecordDescription> RecordingOptions::describe(
    const config::ApplicationDescription& application) const {
  if (file.empty() && !is_asked && !application.record) {
    return std::nullopt;
  }
  config::RecordDescription record = application.record.value_or(config::RecordDescription{});
  if (!file.empty()) {
    record.file = file;
  }
  if (record.file.empty()) {
    record.file = name_by_time(application.name);
  }
  if (!topics.empty() || !except.empty()) {
    record.topics = topics;
    record.except = except;
    record.place.file = "the command line";
  }
  if (const auto found = find_compression(compression)) {
    record.compression = *found;
    record.compression_by_topic.clear();
  }
  if (split_mb || split_s) {
    record.split_bytes = static_cast<std::uint64_t>(std::llround(split_mb.value_or(0) * 1e6));
    record.split_time = std::chrono::nanoseconds(std::llround(split_s.value_or(0) * 1e9));
  }
  return record;
}

}  // namespace fastcycle::tool

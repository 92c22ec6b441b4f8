#include "archive/overview.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <string_view>
#include <system_error>
#include <utility>
#include <variant>

#include "archive/tail.h"
#include "mcap/reader.h"
#include "mcap/record_reader.h"

namespace fastcycle::archive {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostMetadataBytes = std::uint64_t{1} << 20U;

std::uint64_t number_in(const mcap::Metadata& metadata, const std::string& key) {
  const auto found = metadata.metadata.find(key);
  std::uint64_t number = 0;
  if (found != metadata.metadata.end()) {
    const std::string& text = found->second;
    std::from_chars(text.data(), text.data() + text.size(), number);
  }
  return number;
}

TopicLoss loss_of(const mcap::Metadata& metadata) {
  constexpr std::string_view kReason = "lost.";
  TopicLoss loss{.published = number_in(metadata, "published"),
                 .recorded = number_in(metadata, "recorded"),
                 .lost = number_in(metadata, "lost")};
  for (const auto& [key, value] : metadata.metadata) {
    const std::uint64_t count = key.starts_with(kReason) ? number_in(metadata, key) : 0;
    if (count > 0) {
      loss.reasons[key.substr(kReason.size())] = count;
    }
  }
  return loss;
}

void add_channels(const mcap::Reader& reader, Overview& result) {
  for (const auto& [id, channel] : reader.definitions().channels()) {
    TopicOverview& topic = result.topics[channel.topic];
    ++topic.channels;
    topic.encodings.insert(channel.message_encoding);
    if (channel.schema_id != 0) {
      topic.types.insert(reader.definitions().find_schema(channel.schema_id)->name);
    }
    const auto count = result.statistics.channel_message_counts.find(id);
    topic.messages += count == result.statistics.channel_message_counts.end() ? 0 : count->second;
  }
}

void add_metadata(const mcap::Reader& reader, Overview& result) {
  std::uint64_t bytes = 0;
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    mcap::Metadata metadata = reader.read(index);
    const auto topic = metadata.metadata.find("topic");
    if (metadata.name == "fastcycle.loss" && topic != metadata.metadata.end()) {
      result.topics[topic->second].loss = loss_of(metadata);
    }
    bytes += index.length;
    if (bytes <= kMostMetadataBytes) {
      result.metadata.push_back(std::move(metadata));
    }
  }
}

void add_chunk(Overview& result, const std::string& compression, std::uint64_t compressed,
               std::uint64_t uncompressed) {
  ChunkOverview& chunks = result.chunks[compression];
  ++chunks.count;
  chunks.compressed_bytes += compressed;
  chunks.uncompressed_bytes += uncompressed;
}

/// Reads everything, for data that is not in the summary.
void read_whole(const mcap::Source& file, Overview& result, const Progress& progress) {
  mcap::RecordReader reader(file);
  std::map<std::uint16_t, std::uint64_t> bytes;
  unsigned records = 0;
  while (const std::optional<mcap::Record> record = reader.next()) {
    if (const auto* message = std::get_if<mcap::Message>(&*record)) {
      bytes[message->channel_id] += message->data.size();
    } else if (const auto* chunk = std::get_if<mcap::Chunk>(&*record)) {
      add_chunk(result, chunk->compression, chunk->records.size(), chunk->uncompressed_size);
    }
    if (progress && ++records % kRecordsPerProgress == 0) {
      progress(reader.next_offset());
    }
  }
  if (reader.stop()->reason != mcap::Stop::Reason::kEnd) {
    result.problem = reader.stop()->problem;
  }
  for (const auto& [id, channel] : reader.definitions().channels()) {
    std::optional<std::uint64_t>& sum = result.topics[channel.topic].bytes;
    sum = sum.value_or(0) + bytes[id];
  }
  result.was_read = true;
}

}  // namespace

Overview overview(const mcap::Source& file, const OverviewOptions& options,
                  const Progress& progress) {
  const mcap::Reader reader(file);
  Overview result{.file = file.name(),
                  .bytes = file.size(),
                  .header = reader.header(),
                  .statistics = *reader.statistics(),
                  .attachments = reader.attachments(),
                  .was_scanned = reader.was_scanned(),
                  .problem = reader.problem()};
  add_channels(reader, result);
  add_metadata(reader, result);
  if (file.size() <= options.read_whole_bytes || result.was_scanned) {
    read_whole(file, result, progress);
  } else {
    read_summary(file, {}, [&](const mcap::Record& record) {
      if (const auto* index = std::get_if<mcap::ChunkIndex>(&record)) {
        add_chunk(result, index->compression, index->compressed_size, index->uncompressed_size);
      }
    });
  }
  return result;
}

std::vector<fs::path> files_of_recording(const fs::path& name) {
  std::error_code ignored;
  if (fs::exists(name, ignored)) {
    return {name};
  }
  const std::string begin = name.stem().string() + "_";
  const std::string end = name.extension().string();
  const fs::path folder = name.parent_path().empty() ? "." : name.parent_path();
  std::map<unsigned long, fs::path> files;  // By their numbers.
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    std::string text = entry.path().filename().string();
    constexpr std::string_view kActive = ".active";
    if (text.ends_with(kActive)) {
      text.resize(text.size() - kActive.size());
    }
    if (!text.starts_with(begin) || !text.ends_with(end) ||
        text.size() <= begin.size() + end.size()) {
      continue;
    }
    const std::string digits = text.substr(begin.size(), text.size() - begin.size() - end.size());
    if (digits.size() >= 4 && digits.size() <= 9 &&
        std::ranges::all_of(digits, [](char c) { return c >= '0' && c <= '9'; })) {
      files.emplace(std::strtoul(digits.c_str(), nullptr, 10),
                    name.parent_path() / entry.path().filename());
    }
  }
  std::vector<fs::path> result;
  for (auto& [number, path] : files) {
    result.push_back(std::move(path));
  }
  return result.empty() ? std::vector{name} : result;
}

}  // namespace fastcycle::archive

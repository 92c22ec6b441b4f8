#include "archive/doctor.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>

#include "archive/message_type.h"
#include "mcap/decode.h"

namespace fastcycle::archive {
namespace {

using mcap::name_of;
using mcap::Opcode;
using mcap::shown;

/// Shared by the checks: the receiver of findings, and the state of the file.
class Findings {
 public:
  Findings(std::string file, const std::function<void(const Finding&)>& report)
      : file_(std::move(file)), report_(report) {}

  void error(mcap::Problem problem) {
    if (++diagnosis.errors <= Diagnosis::kReportedMax) {
      report_({.is_warning = false, .problem = std::move(problem)});
    }
  }
  void error(const mcap::Place& place, Opcode record, std::string expected, std::string found) {
    error({.place = place,
           .record = name_of(record),
           .expected = std::move(expected),
           .found = std::move(found)});
  }
  void warn(const mcap::Place& place, Opcode record, std::string expected, std::string found) {
    if (++diagnosis.warnings <= Diagnosis::kReportedMax) {
      report_({.is_warning = true,
               .problem = {.place = place,
                           .record = name_of(record),
                           .expected = std::move(expected),
                           .found = std::move(found)}});
    }
  }
  [[nodiscard]] mcap::Place at(std::uint64_t offset) const {
    return {.file = file_, .offset = offset};
  }

  Diagnosis diagnosis;

 private:
  const std::string file_;
  const std::function<void(const Finding&)>& report_;
};

/// The first field of two records that is not the same.
class Difference {
 public:
  template <typename Value>
  Difference& field(const char* name, const Value& expected, const Value& found) {
    if (!expected_ && expected != found) {
      expected_ = fmt::format("{} {}", name, expected);
      found_ = fmt::format("{}", found);
    }
    return *this;
  }
  Difference& text(const char* name, const std::string& expected, const std::string& found) {
    return field(name, shown(expected), shown(found));
  }
  void report(Findings& findings, const mcap::Place& place, Opcode record, const char* why) const {
    if (expected_) {
      findings.error(place, record, fmt::format("{}, {}", *expected_, why), found_);
    }
  }

 private:
  std::optional<std::string> expected_;
  std::string found_;
};

// ---- Chunks and the message indexes behind them ----

/// Compares a chunk and its message indexes with its messages.
class ChunkCheck {
 public:
  using Entry = mcap::MessageIndex::Entry;

  explicit ChunkCheck(Findings& findings) : findings_(findings) {}

  void begin(const mcap::Chunk& chunk, std::uint64_t offset, std::uint64_t end) {
    is_open_ = true;
    index_ = {.message_start_time_ns = chunk.message_start_time_ns,
              .message_end_time_ns = chunk.message_end_time_ns,
              .chunk_start_offset = offset,
              .chunk_length = end - offset,
              .compression = chunk.compression,
              .compressed_size = chunk.records.size(),
              .uncompressed_size = chunk.uncompressed_size};
    entries_.clear();
    count_ = 0;
  }

  [[nodiscard]] bool has(const mcap::Place& place) const {
    return is_open_ && place.offset_in_chunk && place.offset == index_.chunk_start_offset;
  }

  void take(const mcap::Message& message, std::uint64_t offset_in_chunk) {
    entries_[message.channel_id].push_back(
        {.log_time_ns = message.log_time_ns, .offset = offset_in_chunk});
    first_ns_ = count_ == 0 ? message.log_time_ns : std::min(first_ns_, message.log_time_ns);
    last_ns_ = count_ == 0 ? message.log_time_ns : std::max(last_ns_, message.log_time_ns);
    ++count_;
  }

  void take(mcap::MessageIndex index, const mcap::Place& place, std::uint64_t length) {
    if (!is_open_) {
      if (!is_unknown_) {
        findings_.error(place, Opcode::kMessageIndex, "a chunk before it", "none");
      }
      return;
    }
    index_.message_index_length += length;
    for (const auto& [channel_id, offset] : index_.message_index_offsets) {
      if (channel_id == index.channel_id) {
        findings_.error(place, Opcode::kMessageIndex, "one for each channel of a chunk",
                        fmt::format("a second one for channel {}", channel_id));
        return;
      }
    }
    index_.message_index_offsets.push_back(
        {.channel_id = index.channel_id, .offset = place.offset});
    compare(std::move(index), place);
  }

  /// Called at the end of a chunk and its indexes. Returns the expected chunk index, if there was a
  /// chunk.
  std::optional<mcap::ChunkIndex> end() {
    is_unknown_ = false;
    if (!std::exchange(is_open_, false)) {
      return {};
    }
    const mcap::Place place = findings_.at(index_.chunk_start_offset);
    Difference()
        .field("message_start_time", count_ == 0 ? index_.message_start_time_ns : first_ns_,
               index_.message_start_time_ns)
        .field("message_end_time", count_ == 0 ? index_.message_end_time_ns : last_ns_,
               index_.message_end_time_ns)
        .report(findings_, place, Opcode::kChunk, "as in its messages");
    if (!index_.message_index_offsets.empty()) {
      find_missing(place);
    }
    return index_;
  }

  /// The chunk is damaged: what it had is not known.
  void give_up() {
    is_open_ = false;
    is_unknown_ = true;
  }

 private:
  void compare(mcap::MessageIndex index, const mcap::Place& place) {
    static const std::vector<Entry> kNone;
    const auto found = entries_.find(index.channel_id);
    const std::vector<Entry>& there = found == entries_.end() ? kNone : found->second;
    std::ranges::sort(index.entries, {}, &Entry::offset);  // As they stand in the chunk.
    if (index.entries.size() != there.size()) {
      findings_.error(place, Opcode::kMessageIndex,
                      fmt::format("{} messages of channel {}, as the chunk has", there.size(),
                                  index.channel_id),
                      fmt::format("{}", index.entries.size()));
      return;
    }
    const auto [said, real] = std::ranges::mismatch(index.entries, there);
    if (said != index.entries.end()) {
      findings_.error(place, Opcode::kMessageIndex,
                      fmt::format("log_time {} at byte {} of the chunk's records",
                                  real->log_time_ns, real->offset),
                      fmt::format("{} at {}", said->log_time_ns, said->offset));
    }
  }

  void find_missing(const mcap::Place& place) {
    std::set<std::uint16_t> indexed;
    for (const auto& [channel_id, offset] : index_.message_index_offsets) {
      indexed.insert(channel_id);
    }
    for (const auto& [channel_id, entries] : entries_) {
      if (!indexed.contains(channel_id)) {
        findings_.error(place, Opcode::kChunk,
                        fmt::format("a message index for channel {}", channel_id), "none");
      }
    }
  }

  Findings& findings_;
  bool is_open_ = false;
  bool is_unknown_ = false;
  mcap::ChunkIndex index_;
  std::map<std::uint16_t, std::vector<Entry>> entries_;
  std::uint64_t count_ = 0;
  std::uint64_t first_ns_ = 0;
  std::uint64_t last_ns_ = 0;
};

// ---- The summary ----

/// Compares the summary with what the data section had.
class SummaryCheck {
 public:
  SummaryCheck(Findings& findings, std::uint64_t most_bytes)
      : findings_(findings), most_bytes_(most_bytes) {}

  // The contents of the data section.
  void has(const mcap::Schema& schema) { schemas_.insert(schema.id); }
  void has(const mcap::Channel& channel) { channels_.insert(channel.id); }
  void has(const mcap::Message& message) {
    Stats& seen = seen_;
    seen.message_start_time_ns = seen.message_count == 0
                                     ? message.log_time_ns
                                     : std::min(seen.message_start_time_ns, message.log_time_ns);
    seen.message_end_time_ns = std::max(seen.message_end_time_ns, message.log_time_ns);
    ++seen.message_count;
    ++seen.channel_message_counts[message.channel_id];
  }
  void has_outside(const mcap::Place& place) {
    if (outside_count_++ == 0) {
      first_outside_ = place.offset;
    }
  }
  void has(mcap::ChunkIndex index) {
    ++seen_.chunk_count;
    const std::uint64_t offset = index.chunk_start_offset;
    keep(chunks_, offset, std::move(index), 0);
  }
  void has(const mcap::Attachment& attachment, std::uint64_t offset, std::uint64_t end) {
    ++seen_.attachment_count;
    keep(attachments_, offset,
         {.offset = offset,
          .length = end - offset,
          .log_time_ns = attachment.log_time_ns,
          .create_time_ns = attachment.create_time_ns,
          .data_size = attachment.data.size(),
          .name = attachment.name,
          .media_type = attachment.media_type},
         attachment.name.size() + attachment.media_type.size());
  }
  void has(const mcap::Metadata& metadata, std::uint64_t offset, std::uint64_t end) {
    ++seen_.metadata_count;
    keep(metadata_, offset, {.offset = offset, .length = end - offset, .name = metadata.name},
         metadata.name.size());
  }

  // The contents of the summary.
  void check(const mcap::Schema& schema, const mcap::Place& place) {
    ++listed_schemas_;
    if (!schemas_.contains(schema.id)) {
      findings_.error(place, Opcode::kSchema, "a schema that the data section has too",
                      fmt::format("id {}, which is only here", schema.id));
    }
  }
  void check(const mcap::Channel& channel, const mcap::Place& place) {
    ++listed_channels_;
    if (!channels_.contains(channel.id)) {
      findings_.error(place, Opcode::kChannel, "a channel that the data section has too",
                      fmt::format("id {}, which is only here", channel.id));
    }
  }
  void check(const mcap::Statistics& listed, const mcap::Place& place) {
    if (std::exchange(has_statistics_, true)) {
      findings_.error(place, Opcode::kStatistics, "one Statistics", "a second one");
    }
    seen_.schema_count = static_cast<std::uint16_t>(schemas_.size());
    seen_.channel_count = static_cast<std::uint32_t>(channels_.size());
    Difference difference;
    difference.field("message_count", seen_.message_count, listed.message_count)
        .field("schema_count", seen_.schema_count, listed.schema_count)
        .field("channel_count", seen_.channel_count, listed.channel_count)
        .field("attachment_count", seen_.attachment_count, listed.attachment_count)
        .field("metadata_count", seen_.metadata_count, listed.metadata_count)
        .field("chunk_count", seen_.chunk_count, listed.chunk_count)
        .field("message_start_time", seen_.message_start_time_ns, listed.message_start_time_ns)
        .field("message_end_time", seen_.message_end_time_ns, listed.message_end_time_ns);
    for (const std::uint16_t channel : channels_) {
      difference.field(fmt::format("channel_message_counts of channel {}:", channel).c_str(),
                       count_in(seen_, channel), count_in(listed, channel));
    }
    difference.report(findings_, place, Opcode::kStatistics, kAsThere);
  }
  void check(mcap::ChunkIndex listed, const mcap::Place& place) {
    ++listed_chunks_;
    const mcap::ChunkIndex* const real =
        find(chunks_, listed.chunk_start_offset, place, Opcode::kChunkIndex);
    if (real == nullptr) {
      return;
    }
    Difference()
        .field("message_start_time", real->message_start_time_ns, listed.message_start_time_ns)
        .field("message_end_time", real->message_end_time_ns, listed.message_end_time_ns)
        .field("chunk_length", real->chunk_length, listed.chunk_length)
        .field("message_index_offsets", text_of(*real), text_of(listed))
        .field("message_index_length", real->message_index_length, listed.message_index_length)
        .text("compression", real->compression, listed.compression)
        .field("compressed_size", real->compressed_size, listed.compressed_size)
        .field("uncompressed_size", real->uncompressed_size, listed.uncompressed_size)
        .report(findings_, place, Opcode::kChunkIndex, kAsThere);
  }
  void check(const mcap::AttachmentIndex& listed, const mcap::Place& place) {
    ++listed_attachments_;
    const auto* const real = find(attachments_, listed.offset, place, Opcode::kAttachmentIndex);
    if (real != nullptr) {
      Difference()
          .field("length", real->length, listed.length)
          .field("log_time", real->log_time_ns, listed.log_time_ns)
          .field("create_time", real->create_time_ns, listed.create_time_ns)
          .field("data_size", real->data_size, listed.data_size)
          .text("name", real->name, listed.name)
          .text("media_type", real->media_type, listed.media_type)
          .report(findings_, place, Opcode::kAttachmentIndex, kAsThere);
    }
  }
  void check(const mcap::MetadataIndex& listed, const mcap::Place& place) {
    ++listed_metadata_;
    const auto* const real = find(metadata_, listed.offset, place, Opcode::kMetadataIndex);
    if (real != nullptr) {
      Difference()
          .field("length", real->length, listed.length)
          .text("name", real->name, listed.name)
          .report(findings_, place, Opcode::kMetadataIndex, kAsThere);
    }
  }
  void check(const mcap::SummaryOffset& listed, const mcap::Place& place) {
    first_offset_ = first_offset_ == 0 ? place.offset : first_offset_;
    const auto group = std::ranges::find_if(groups_, [&](const Group& one) {
      return one.opcode == listed.group_opcode && one.begin == listed.group_start;
    });
    if (group == groups_.end()) {
      findings_.error(place, Opcode::kSummaryOffset,
                      fmt::format("the beginning of the records {}", name_of(listed.group_opcode)),
                      fmt::format("byte {}, which is not their beginning", listed.group_start));
    } else {
      Difference()
          .field("group_length", group->end - group->begin, listed.group_length)
          .report(findings_, place, Opcode::kSummaryOffset, kAsThere);
    }
  }
  void check(const mcap::Footer& listed, const mcap::Place& place) {
    Difference()
        .field("summary_offset_start", first_offset_, listed.summary_offset_start)
        .report(findings_, place, Opcode::kFooter, kAsThere);
    end(place);
  }

  /// A record of the summary stands here.
  void note_group(Opcode opcode, std::uint64_t begin, std::uint64_t end) {
    if (!groups_.empty() && groups_.back().opcode == opcode && groups_.back().end == begin) {
      groups_.back().end = end;
    } else if (groups_.size() < kMostGroups) {
      groups_.push_back({.opcode = opcode, .begin = begin, .end = end});
    }
  }

 private:
  using Stats = mcap::Statistics;
  struct Group {
    Opcode opcode{};
    std::uint64_t begin = 0;
    std::uint64_t end = 0;
  };
  static constexpr const char* kAsThere = "as the file has it";
  static constexpr std::size_t kMostGroups = 64;  // There are six kinds.

  static std::uint64_t count_in(const Stats& statistics, std::uint16_t channel) {
    const auto found = statistics.channel_message_counts.find(channel);
    return found == statistics.channel_message_counts.end() ? 0 : found->second;
  }

  static std::string text_of(const mcap::ChunkIndex& index) {
    std::map<std::uint16_t, std::uint64_t> sorted;
    for (const auto& [channel_id, offset] : index.message_index_offsets) {
      sorted.emplace(channel_id, offset);
    }
    std::string text;
    for (const auto& [channel_id, offset] : sorted) {
      text += fmt::format("{}{}@{}", text.empty() ? "" : " ", channel_id, offset);
    }
    return text.empty() ? "none" : text;
  }

  template <typename Index>
  void keep(std::map<std::uint64_t, Index>& indexes, std::uint64_t offset, Index index,
            std::uint64_t more_bytes) {
    constexpr std::uint64_t kMapNode = 64;
    bytes_ += sizeof(Index) + kMapNode + more_bytes;
    if constexpr (requires { index.message_index_offsets; }) {
      bytes_ += index.message_index_offsets.size() * sizeof(index.message_index_offsets[0]);
    }
    if (bytes_ <= most_bytes_) {
      indexes.emplace(offset, std::move(index));
    } else if (!std::exchange(is_too_large_, true)) {
      findings_.error(
          {.place = findings_.at(offset),
           .record = {},
           .expected = fmt::format("a file with at most {} bytes of index", most_bytes_),
           .found = "more"});
    }
  }

  template <typename Index>
  const Index* find(const std::map<std::uint64_t, Index>& indexes, std::uint64_t offset,
                    const mcap::Place& place, Opcode record) {
    const auto found = indexes.find(offset);
    if (found != indexes.end()) {
      return &found->second;
    }
    if (!is_too_large_) {
      findings_.error(place, record, "the offset of the record that it names",
                      fmt::format("byte {}, which holds something else", offset));
    }
    return nullptr;
  }

  void end(const mcap::Place& place) {
    const auto compare = [&](Opcode record, std::uint64_t there, std::uint64_t said) {
      if (said > 0 && said != there) {
        findings_.error(place, record,
                        fmt::format("{} of them in the summary, {}", there, kAsThere),
                        fmt::format("{}", said));
      }
    };
    compare(Opcode::kSchema, schemas_.size(), listed_schemas_);
    compare(Opcode::kChannel, channels_.size(), listed_channels_);
    compare(Opcode::kChunkIndex, seen_.chunk_count, listed_chunks_);
    compare(Opcode::kAttachmentIndex, seen_.attachment_count, listed_attachments_);
    compare(Opcode::kMetadataIndex, seen_.metadata_count, listed_metadata_);
    if (listed_chunks_ > 0 && outside_count_ > 0) {
      findings_.error(findings_.at(first_outside_), Opcode::kMessage,
                      "messages in chunks, since there is a chunk index",
                      fmt::format("{} outside of chunks", outside_count_));
    }
  }

  Findings& findings_;
  const std::uint64_t most_bytes_;

  Stats seen_;
  std::set<std::uint16_t> schemas_;
  std::set<std::uint16_t> channels_;
  std::map<std::uint64_t, mcap::ChunkIndex> chunks_;
  std::map<std::uint64_t, mcap::AttachmentIndex> attachments_;
  std::map<std::uint64_t, mcap::MetadataIndex> metadata_;
  std::uint64_t bytes_ = 0;
  bool is_too_large_ = false;
  std::uint64_t outside_count_ = 0;
  std::uint64_t first_outside_ = 0;

  std::vector<Group> groups_;
  std::uint64_t first_offset_ = 0;  // Of a SummaryOffset; 0: there is none.
  bool has_statistics_ = false;
  std::uint64_t listed_schemas_ = 0;
  std::uint64_t listed_channels_ = 0;
  std::uint64_t listed_chunks_ = 0;
  std::uint64_t listed_attachments_ = 0;
  std::uint64_t listed_metadata_ = 0;
};

// ---- Messages ----

/// Times and numbers of one channel.
class ChannelCheck {
 public:
  /// `may_be_repeated`: at the beginning of a file, with a number of long ago, and a log time that
  /// is not its publish time.
  void take(const mcap::Message& message, std::uint64_t offset, bool may_be_repeated) {
    if (count_ == 0) {
      first_sequence_ = message.sequence;
    } else if (message.log_time_ns < last_ns_ && backwards_++ == 0) {
      first_backwards_ = offset;
    }
    last_ns_ = message.log_time_ns;
    ++count_;
    if (!may_be_repeated || message.log_time_ns == message.publish_time_ns) {
      const auto step = static_cast<std::int32_t>(message.sequence - first_sequence_);
      lowest_ = numbered_ == 0 ? step : std::min<std::int64_t>(lowest_, step);
      highest_ = numbered_ == 0 ? step : std::max<std::int64_t>(highest_, step);
      ++numbered_;
    }
  }

  void conclude(const mcap::Channel& channel, Findings& findings) const {
    if (backwards_ > 0) {
      findings.warn(findings.at(first_backwards_), Opcode::kMessage,
                    fmt::format("non-decreasing log times of channel {} ({})", channel.id,
                                shown(channel.topic)),
                    fmt::format("{} decreasing ones, the first here", backwards_));
    }
    const std::uint64_t span = static_cast<std::uint64_t>(highest_ - lowest_) + 1;
    const bool has_numbers = highest_ > lowest_;
    if (has_numbers && span > numbered_) {
      findings.warn(findings.at(mcap::Place::kWholeFile), Opcode::kMessage,
                    fmt::format("all sequences of channel {} ({}) from its first to its last",
                                channel.id, shown(channel.topic)),
                    fmt::format("{} missing", span - numbered_));
    }
  }

 private:
  std::uint64_t count_ = 0;
  std::uint64_t last_ns_ = 0;
  std::uint64_t backwards_ = 0;
  std::uint64_t first_backwards_ = 0;
  std::uint32_t first_sequence_ = 0;
  std::uint64_t numbered_ = 0;
  std::int64_t lowest_ = 0;  // Counted from the first.
  std::int64_t highest_ = 0;
};

std::optional<std::uint64_t> number_of(const mcap::Metadata& metadata, const std::string& key) {
  const auto found = metadata.metadata.find(key);
  if (found == metadata.metadata.end()) {
    return {};
  }
  const std::string& text = found->second;
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(number)
                                                                  : std::nullopt;
}

/// Checks the losses in FastCycle's logs: published = recorded + lost, and lost is the sum of its
/// reasons.
void check_loss(const mcap::Metadata& metadata, const mcap::Place& place, Findings& findings) {
  std::map<std::string, std::uint64_t> numbers;
  std::uint64_t reasons = 0;
  for (const auto& [key, value] : metadata.metadata) {
    if (key == "topic") {
      continue;
    }
    const std::optional<std::uint64_t> number = number_of(metadata, key);
    if (!number) {
      findings.error(place, Opcode::kMetadata, "a number for " + shown(key), shown(value));
      return;
    }
    numbers[key] = *number;
    reasons += key.starts_with("lost.") ? *number : 0;
  }
  const auto topic = metadata.metadata.find("topic");
  const std::string name = topic == metadata.metadata.end() ? "?" : shown(topic->second);
  if (numbers["published"] != numbers["recorded"] + numbers["lost"]) {
    findings.error(
        place, Opcode::kMetadata, fmt::format("published = recorded + lost for {}", name),
        fmt::format("{} = {} + {}", numbers["published"], numbers["recorded"], numbers["lost"]));
  }
  if (reasons != numbers["lost"]) {
    findings.error(place, Opcode::kMetadata,
                   fmt::format("lost {} for {}, the sum of its reasons", reasons, name),
                   fmt::format("{}", numbers["lost"]));
  }
}

// ---- All of it ----

class Doctor {
 public:
  Doctor(const mcap::Source& file, const std::function<void(const Finding&)>& report,
         const mcap::ReadLimits& limits, const Progress& progress)
      : file_(file),
        progress_(progress),
        findings_(file.name(), report),
        reader_(file, {.limits = limits}),
        chunk_(findings_),
        summary_(findings_, limits.index_bytes) {}

  Diagnosis run() {
    do {
      while (const std::optional<mcap::Record> record = reader_.next()) {
        take(*record);
      }
    } while (note_stop());
    end_chunk();
    for (const auto& [id, check] : channels_) {
      check.conclude(*reader_.definitions().find_channel(id), findings_);
    }
    return findings_.diagnosis;
  }

 private:
  /// Reports why reading stopped. Returns whether it can continue.
  bool note_stop() {
    const mcap::Stop stop = *reader_.stop();
    if (stop.reason == mcap::Stop::Reason::kEnd) {
      return false;
    }
    findings_.error(stop.problem);
    is_damaged_ = true;
    chunk_.give_up();
    if (stop.reason != mcap::Stop::Reason::kDamaged || reader_.resume()) {
      return stop.reason == mcap::Stop::Reason::kDamaged;
    }
    const std::uint64_t left = file_.size() - std::min(file_.size(), stop.problem.place.offset);
    if (left > 0) {
      findings_.error({.place = stop.problem.place,
                       .record = {},
                       .expected = "a valid record after it",
                       .found = fmt::format("{} unreadable bytes", left)});
    }
    return false;
  }

  void take(const mcap::Record& record) {
    const mcap::Place& place = reader_.place();
    if (!place.offset_in_chunk && !std::holds_alternative<mcap::MessageIndex>(record)) {
      end_chunk();
    }
    if (!reader_.is_past_data()) {
      std::visit([&](const auto& one) { take_data(one, place); }, record);
    } else if (!is_damaged_) {
      std::visit([&](const auto& one) { take_summary(one, place); }, record);
    }
    if (progress_ && ++records_ % kRecordsPerProgress == 0) {
      progress_(reader_.next_offset());
    }
  }

  void end_chunk() {
    if (std::optional<mcap::ChunkIndex> index = chunk_.end()) {
      summary_.has(std::move(*index));
    }
  }

  void take_data(const mcap::Header& header, const mcap::Place& place) {
    is_ours_ = header.profile == "fastcycle";
    if (header.library.empty()) {
      findings_.warn(place, Opcode::kHeader, "the name of the library that wrote it", "none");
    }
  }

  void take_data(const mcap::Schema& schema, const mcap::Place& place) {
    summary_.has(schema);
    if (schema.encoding == "protobuf") {
      const MessageTypes::Found& found = types_.find(schema);
      if (found.type == nullptr && reported_schemas_.insert(schema.id).second) {
        findings_.error(place, Opcode::kSchema,
                        "all definitions needed to read " + shown(schema.name), found.problem);
      }
    }
  }

  void take_data(const mcap::Channel& channel, const mcap::Place& place) {
    summary_.has(channel);
    if (channel.message_encoding != "protobuf" || type_of_channel_.contains(channel.id)) {
      return;
    }
    const mcap::Schema* const schema = reader_.definitions().find_schema(channel.schema_id);
    const bool is_protobuf = schema != nullptr && schema->encoding == "protobuf";
    type_of_channel_[channel.id] = is_protobuf ? types_.find(*schema).type : nullptr;
    if (!is_protobuf) {
      findings_.error(place, Opcode::kChannel,
                      fmt::format("a schema of protobuf for {}", shown(channel.topic)),
                      schema == nullptr ? "none" : "one of " + shown(schema->encoding));
    }
  }

  void take_data(const mcap::Message& message, const mcap::Place& place) {
    ++findings_.diagnosis.messages;
    summary_.has(message);
    if (chunk_.has(place)) {
      chunk_.take(message, *place.offset_in_chunk);
    } else if (!place.offset_in_chunk) {
      summary_.has_outside(place);
    }
    channels_[message.channel_id].take(message, place.offset, is_ours_);
    const auto type = type_of_channel_.find(message.channel_id);
    if (type == type_of_channel_.end() || type->second == nullptr) {
      return;
    }
    if (std::optional<std::string> wrong = type->second->find_wrong(message.data)) {
      findings_.error(place, Opcode::kMessage,
                      "a " + type->second->descriptor().full_name() + ", as its schema says",
                      std::move(*wrong));
    }
  }

  void take_data(const mcap::Chunk& chunk, const mcap::Place& place) {
    ++findings_.diagnosis.chunks;
    chunk_.begin(chunk, place.offset, reader_.next_offset());
  }
  void take_data(const mcap::MessageIndex& index, const mcap::Place& place) {
    chunk_.take(index, place, reader_.next_offset() - place.offset);
  }
  void take_data(const mcap::Attachment& attachment, const mcap::Place& place) {
    summary_.has(attachment, place.offset, reader_.next_offset());
  }
  void take_data(const mcap::Metadata& metadata, const mcap::Place& place) {
    summary_.has(metadata, place.offset, reader_.next_offset());
    if (metadata.name == "fastcycle.loss") {
      check_loss(metadata, place, findings_);
    }
  }
  template <typename Other>
  void take_data(const Other& /*nothing to check*/, const mcap::Place& /*place*/) {}

  template <typename Kind>
  void take_summary(const Kind& record, const mcap::Place& place) {
    if constexpr (requires { summary_.check(record, place); }) {
      summary_.note_group(opcode_of(record), place.offset, reader_.next_offset());
      summary_.check(record, place);
    }
  }

  static Opcode opcode_of(const mcap::Schema& /*one*/) { return Opcode::kSchema; }
  static Opcode opcode_of(const mcap::Channel& /*one*/) { return Opcode::kChannel; }
  static Opcode opcode_of(const mcap::Statistics& /*one*/) { return Opcode::kStatistics; }
  static Opcode opcode_of(const mcap::ChunkIndex& /*one*/) { return Opcode::kChunkIndex; }
  static Opcode opcode_of(const mcap::AttachmentIndex& /*one*/) { return Opcode::kAttachmentIndex; }
  static Opcode opcode_of(const mcap::MetadataIndex& /*one*/) { return Opcode::kMetadataIndex; }
  static Opcode opcode_of(const mcap::SummaryOffset& /*one*/) { return Opcode::kSummaryOffset; }
  static Opcode opcode_of(const mcap::Footer& /*one*/) { return Opcode::kFooter; }

  const mcap::Source& file_;
  const Progress& progress_;
  Findings findings_;
  mcap::RecordReader reader_;
  ChunkCheck chunk_;
  SummaryCheck summary_;
  MessageTypes types_;
  std::set<std::uint16_t> reported_schemas_;
  std::map<std::uint16_t, const MessageType*> type_of_channel_;
  std::map<std::uint16_t, ChannelCheck> channels_;
  bool is_ours_ = false;
  bool is_damaged_ = false;
  unsigned records_ = 0;
};

}  // namespace

Diagnosis diagnose(const mcap::Source& file, const std::function<void(const Finding&)>& report,
                   const mcap::ReadLimits& limits, const Progress& progress) {
  return Doctor(file, report, limits, progress).run();
}

}  // namespace fastcycle::archive

#include "mcap/writer.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "mcap/decode.h"
#include "mcap/encode.h"
#include "mcap/error.h"

namespace fastcycle::mcap {

Writer::Writer(Sink& sink, WriterOptions options)
    : sink_(sink), options_(std::move(options)), chunk_(options_.chunk) {
  scratch_.assign(kMagic.begin(), kMagic.end());
  encode(Header{.profile = options_.profile, .library = options_.library}, scratch_);
  append(scratch_);
}

void Writer::require_open(Opcode record) const {
  if (has_failed_) {
    refuse(record, "a file that could be written so far", "one where that failed before");
  }
  if (is_closed_) {
    refuse(record, "a file that is open", "one that was closed");
  }
}

void Writer::refuse(Opcode record, std::string expected, std::string found) const {
  throw Error({.place = place(),
               .record = name_of(record),
               .expected = std::move(expected),
               .found = std::move(found)});
}

void Writer::put(std::span<const Bytes> parts) {
  has_failed_ = true;  // Cleared once the sink has accepted it.
  sink_.append(parts);
  has_failed_ = false;
  size_ += size_of(parts);
}

void Writer::add_to_crc(std::span<const Bytes> parts) {
  if (options_.data_crc) {
    std::ranges::for_each(parts, [this](Bytes part) { data_crc_.add(part); });
  }
}

void Writer::append(std::span<const Bytes> parts) {
  put(parts);
  add_to_crc(parts);
}

/// Throws if it conflicts with definitions of the writer or `more`.
void Writer::check(const Schema& schema, const Definitions& more) const {
  if (schema.id == 0) {
    refuse(Opcode::kSchema, "an id that is not 0", "0 for " + shown(schema.name));
  }
  const Schema* there = definitions_.find_schema(schema.id);
  there = there == nullptr ? more.find_schema(schema.id) : there;
  if (there != nullptr && *there != schema) {
    refuse(Opcode::kSchema, fmt::format("{} for id {}, as before", shown(there->name), schema.id),
           "another one, named " + shown(schema.name));
  }
}

void Writer::check(const Channel& channel, const Definitions& more) const {
  if (channel.schema_id != 0 && definitions_.find_schema(channel.schema_id) == nullptr &&
      more.find_schema(channel.schema_id) == nullptr) {
    refuse(Opcode::kChannel, "the id of a schema that was added, or 0",
           fmt::format("{} for {}", channel.schema_id, shown(channel.topic)));
  }
  const Channel* there = definitions_.find_channel(channel.id);
  there = there == nullptr ? more.find_channel(channel.id) : there;
  if (there != nullptr && *there != channel) {
    refuse(Opcode::kChannel,
           fmt::format("{} for id {}, as before", shown(there->topic), channel.id),
           "another one, named " + shown(channel.topic));
  }
}

void Writer::define(const Schema& schema) {
  statistics_.schema_count =
      static_cast<std::uint16_t>(statistics_.schema_count + definitions_.add(schema, place()));
}

void Writer::define(const Channel& channel) {
  statistics_.channel_count += definitions_.add(channel, place()) ? 1 : 0;
}

template <typename Kind>
void Writer::add_new(const Kind& definition) {
  scratch_.clear();
  encode(definition, scratch_);
  if (options_.chunked) {
    chunk_.add(definition);
  } else {
    append(scratch_);
  }
  define(definition);
}

void Writer::add(const Schema& schema) {
  require_open(Opcode::kSchema);
  check(schema, {});
  if (definitions_.find_schema(schema.id) == nullptr) {
    add_new(schema);
  }
}

void Writer::add(const Channel& channel) {
  require_open(Opcode::kChannel);
  check(channel, {});
  if (definitions_.find_channel(channel.id) == nullptr) {
    add_new(channel);
  }
}

void Writer::write(const MessageHead& head, std::span<const Bytes> data) {
  require_open(Opcode::kMessage);
  if (definitions_.find_channel(head.channel_id) == nullptr) {
    refuse(Opcode::kMessage, "a channel that was added", fmt::format("{}", head.channel_id));
  }
  const std::uint64_t data_size = size_of(data);
  const std::uint64_t record_size = kFrameBytes + kMessageHeadBytes + data_size;
  if (options_.chunked) {
    if (chunk_.message_count() > 0 && chunk_.size() + record_size > options_.chunk_bytes) {
      flush();
    }
    chunk_.add(head, data);
    if (chunk_.size() >= options_.chunk_bytes) {
      flush();
    }
    return;
  }
  const auto bytes = encode_head(head, data_size);
  parts_.assign(1, bytes);
  parts_.insert(parts_.end(), data.begin(), data.end());
  append(parts_);
  count_message(head);
}

void Writer::write(ChunkBuilder& chunk) {
  require_open(Opcode::kChunk);
  if (!options_.chunked) {
    refuse(Opcode::kChunk, "messages outside of chunks, as for all of this file", "a chunk");
  }
  check_channels_of(chunk);
  Definitions more;
  for (const ChunkBuilder::Definition& definition : chunk.definitions()) {
    std::visit(
        [&](const auto& record) {
          check(record, more);
          more.add(record, place());
        },
        definition.record);
  }
  flush();
  append_chunk(chunk);
  for (const ChunkBuilder::Definition& definition : chunk.definitions()) {
    std::visit([&](const auto& record) { define(record); }, definition.record);
  }
}

/// Every message must have its channel defined before it, here or earlier in the file.
void Writer::check_channels_of(const ChunkBuilder& chunk) const {
  for (const MessageIndex& index : chunk.message_indexes()) {
    const auto defines = [&](const ChunkBuilder::Definition& definition) {
      const auto* const channel = std::get_if<Channel>(&definition.record);
      return channel != nullptr && channel->id == index.channel_id &&
             definition.offset < index.entries.front().offset;
    };
    if (definitions_.find_channel(index.channel_id) == nullptr &&
        std::ranges::none_of(chunk.definitions(), defines)) {
      refuse(Opcode::kChunk, "messages of channels that were added",
             fmt::format("one of channel {}", index.channel_id));
    }
  }
}

void Writer::flush() {
  require_open(Opcode::kChunk);
  if (chunk_.is_empty()) {
    return;
  }
  if (chunk_.message_count() > 0) {
    append_chunk(chunk_);
  } else {
    // Schemas and channels alone need no chunk, which readers would have to open.
    scratch_.clear();
    for (const ChunkBuilder::Definition& definition : chunk_.definitions()) {
      std::visit([&](const auto& record) { encode(record, scratch_); }, definition.record);
    }
    append(scratch_);
  }
  chunk_.clear();
}

void Writer::append_chunk(ChunkBuilder& chunk) {
  chunk.close();
  const Chunk& head = chunk.head();
  ChunkIndex index{.message_start_time_ns = head.message_start_time_ns,
                   .message_end_time_ns = head.message_end_time_ns,
                   .chunk_start_offset = size_,
                   .compression = head.compression,
                   .compressed_size = chunk.compressed_size(),
                   .uncompressed_size = head.uncompressed_size};
  scratch_.clear();
  encode_head(head, chunk.compressed_size(), scratch_);
  parts_.assign(1, scratch_);
  parts_.insert(parts_.end(), chunk.parts().begin(), chunk.parts().end());
  put(parts_);
  if (const std::optional<std::uint32_t> crc = chunk.compressed_crc(); crc && options_.data_crc) {
    add_to_crc(std::span(parts_).first(1));
    data_crc_.add(*crc, chunk.compressed_size());
  } else {
    add_to_crc(parts_);
  }
  index.chunk_length = size_ - index.chunk_start_offset;
  append_message_indexes(chunk, index);
  if (options_.chunk_index) {
    encode(index, chunk_indexes_);
  }
  count_chunk(chunk);
}

void Writer::append_message_indexes(const ChunkBuilder& chunk, ChunkIndex& index) {
  if (!options_.message_index || chunk.message_indexes().empty()) {
    return;
  }
  scratch_.clear();
  for (const MessageIndex& one : chunk.message_indexes()) {
    index.message_index_offsets.push_back(
        {.channel_id = one.channel_id, .offset = size_ + scratch_.size()});
    encode(one, scratch_);
  }
  index.message_index_length = scratch_.size();
  append(scratch_);
}

void Writer::count_times(std::uint64_t first_ns, std::uint64_t last_ns) {
  statistics_.message_start_time_ns = statistics_.message_count == 0
                                          ? first_ns
                                          : std::min(statistics_.message_start_time_ns, first_ns);
  statistics_.message_end_time_ns = std::max(statistics_.message_end_time_ns, last_ns);
}

void Writer::count_message(const MessageHead& head) {
  count_times(head.log_time_ns, head.log_time_ns);
  ++statistics_.message_count;
  ++statistics_.channel_message_counts[head.channel_id];
}

void Writer::count_chunk(const ChunkBuilder& chunk) {
  ++statistics_.chunk_count;
  if (chunk.message_count() == 0) {
    return;
  }
  count_times(chunk.head().message_start_time_ns, chunk.head().message_end_time_ns);
  statistics_.message_count += chunk.message_count();
  for (const MessageIndex& index : chunk.message_indexes()) {
    statistics_.channel_message_counts[index.channel_id] += index.entries.size();
  }
}

void Writer::write(const AttachmentHead& head, std::span<const Bytes> data) {
  require_open(Opcode::kAttachment);
  AttachmentIndex index{.offset = size_,
                        .log_time_ns = head.log_time_ns,
                        .create_time_ns = head.create_time_ns,
                        .data_size = size_of(data),
                        .name = head.name,
                        .media_type = head.media_type};
  scratch_.clear();
  encode_head(head, index.data_size, scratch_);
  Crc crc;
  if (options_.attachment_crc) {
    crc.add(Bytes(scratch_).subspan(kFrameBytes));
    std::ranges::for_each(data, [&](Bytes part) { crc.add(part); });
  }
  const auto crc_bytes = encode_u32(crc.value());
  parts_.assign(1, scratch_);
  parts_.insert(parts_.end(), data.begin(), data.end());
  parts_.emplace_back(crc_bytes);
  append(parts_);
  index.length = size_ - index.offset;
  ++statistics_.attachment_count;
  if (options_.attachment_index) {
    encode(index, attachment_indexes_);
  }
}

void Writer::write(const Metadata& metadata) {
  require_open(Opcode::kMetadata);
  scratch_.clear();
  encode(metadata, scratch_);
  const MetadataIndex index{.offset = size_, .length = scratch_.size(), .name = metadata.name};
  append(scratch_);
  ++statistics_.metadata_count;
  if (options_.metadata_index) {
    encode(index, metadata_indexes_);
  }
}

void Writer::close() {
  flush();
  scratch_.clear();
  encode(DataEnd{.data_section_crc = data_crc_.value()}, scratch_);
  append(scratch_);
  append_summary();
  is_closed_ = true;
}

void Writer::append_summary() {
  Footer footer{.summary_start = size_};
  Buffer summary;
  Buffer offsets;
  const auto group = [&](Opcode opcode, const auto& put) {
    const std::uint64_t begin = size_ + summary.size();
    put();
    const std::uint64_t length = size_ + summary.size() - begin;
    if (options_.summary_offsets && length > 0) {
      encode(SummaryOffset{.group_opcode = opcode, .group_start = begin, .group_length = length},
             offsets);
    }
  };
  const auto copy = [&](const Buffer& records) {
    return [&] { summary.insert(summary.end(), records.begin(), records.end()); };
  };
  group(Opcode::kSchema, [&] {
    for (const auto& [id, schema] : definitions_.schemas()) {
      if (options_.repeat_schemas) {
        encode(schema, summary);
      }
    }
  });
  group(Opcode::kChannel, [&] {
    for (const auto& [id, channel] : definitions_.channels()) {
      if (options_.repeat_channels) {
        encode(channel, summary);
      }
    }
  });
  group(Opcode::kStatistics, [&] {
    if (options_.statistics) {
      encode(statistics_, summary);
    }
  });
  group(Opcode::kMetadataIndex, copy(metadata_indexes_));
  group(Opcode::kAttachmentIndex, copy(attachment_indexes_));
  group(Opcode::kChunkIndex, copy(chunk_indexes_));

  if (summary.empty()) {
    footer.summary_start = 0;
  }
  if (!offsets.empty()) {
    footer.summary_offset_start = size_ + summary.size();
    summary.insert(summary.end(), offsets.begin(), offsets.end());
  }
  encode(footer, summary);
  if (options_.summary_crc) {
    // Over all of it except the CRC itself, at the end.
    Crc crc;
    crc.add(Bytes(summary).first(summary.size() - sizeof(std::uint32_t)));
    std::ranges::copy(encode_u32(crc.value()), summary.end() - sizeof(std::uint32_t));
  }
  summary.insert(summary.end(), kMagic.begin(), kMagic.end());
  append(summary);
}

std::uint64_t Writer::index_bytes() const {
  return chunk_indexes_.size() + attachment_indexes_.size() + metadata_indexes_.size();
}

}  // namespace fastcycle::mcap

#include "mcap/decode.h"

#include <algorithm>
#include <concepts>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "mcap/crc.h"
#include "mcap/encode.h"

namespace fastcycle::mcap {
namespace {

template <std::unsigned_integral Number>
Number load(Bytes bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = sizeof(Number); i-- > 0;) {
    value = value << 8U | std::to_integer<std::uint64_t>(bytes[i]);
  }
  return static_cast<Number>(value);
}

/// Takes fields from the beginning of the content of a record, or of a part of it.
class Fields {
 public:
  Fields(Bytes bytes, Opcode record, const Place& place)
      : rest_(bytes), record_(record), place_(place) {}

  template <std::unsigned_integral Number>
  Number number(const char* name) {
    return load<Number>(take(sizeof(Number), name));
  }
  std::uint16_t u16(const char* name) { return number<std::uint16_t>(name); }
  std::uint32_t u32(const char* name) { return number<std::uint32_t>(name); }
  std::uint64_t u64(const char* name) { return number<std::uint64_t>(name); }

  std::string text(const char* name) { return std::string(text_of(take(u32(name), name))); }

  Bytes take(std::uint64_t size, const char* name) {
    if (size > rest_.size()) {
      fail(fmt::format("{} of {} bytes", name, size),
           fmt::format("{} bytes left in the record", rest_.size()));
    }
    const Bytes taken = rest_.first(static_cast<std::size_t>(size));
    rest_ = rest_.subspan(taken.size());
    return taken;
  }

  /// What follows is a list or a map, with its length in bytes before it.
  Fields list(const char* name) { return {take(u32(name), name), record_, place_}; }

  std::map<std::string, std::string> texts(const char* name) {
    std::map<std::string, std::string> map;
    for (Fields entries = list(name); !entries.is_empty();) {
      std::string key = entries.text("a key");
      std::string value = entries.text("a value");
      if (!map.emplace(std::move(key), std::move(value)).second) {
        fail(fmt::format("{} with each key once", name), "one twice");
      }
    }
    return map;
  }

  [[nodiscard]] bool is_empty() const { return rest_.empty(); }
  [[nodiscard]] Bytes rest() const { return rest_; }

  [[noreturn]] void fail(std::string expected, std::string found) const {
    throw Damage({.place = place_,
                  .record = name_of(record_),
                  .expected = std::move(expected),
                  .found = std::move(found)});
  }

 private:
  Bytes rest_;
  Opcode record_;
  const Place& place_;
};

Chunk chunk_head(Fields& fields) {
  Chunk chunk;
  chunk.message_start_time_ns = fields.u64("message_start_time");
  chunk.message_end_time_ns = fields.u64("message_end_time");
  chunk.uncompressed_size = fields.u64("uncompressed_size");
  chunk.uncompressed_crc = fields.u32("uncompressed_crc");
  chunk.compression = fields.text("compression");
  return chunk;
}

}  // namespace

std::string name_of(Opcode opcode) {
  static constexpr std::array<const char*, 16> kNames{
      "",         "Header",        "Footer",        "Schema",     "Channel",         "Message",
      "Chunk",    "MessageIndex",  "ChunkIndex",    "Attachment", "AttachmentIndex", "Statistics",
      "Metadata", "MetadataIndex", "SummaryOffset", "DataEnd"};
  const auto number = static_cast<std::size_t>(opcode);
  return number > 0 && number < kNames.size() ? kNames[number]
                                              : fmt::format("record of opcode {:#04x}", number);
}

Frame decode_frame(Bytes bytes) {
  return {.opcode = static_cast<Opcode>(load<std::uint8_t>(bytes)),
          .length = load<std::uint64_t>(bytes.subspan(1))};
}

template <>
Header decode_as<Header>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kHeader, place);
  Header header;
  header.profile = fields.text("profile");
  header.library = fields.text("library");
  return header;
}

template <>
Footer decode_as<Footer>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kFooter, place);
  if (content.size() != kFooterBytes) {
    fields.fail(fmt::format("{} bytes", kFooterBytes), fmt::format("{} bytes", content.size()));
  }
  Footer footer;
  footer.summary_start = fields.u64("summary_start");
  footer.summary_offset_start = fields.u64("summary_offset_start");
  footer.summary_crc = fields.u32("summary_crc");
  return footer;
}

template <>
Schema decode_as<Schema>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kSchema, place);
  Schema schema;
  schema.id = fields.u16("id");
  schema.name = fields.text("name");
  schema.encoding = fields.text("encoding");
  schema.data = fields.text("data");
  return schema;
}

template <>
Channel decode_as<Channel>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kChannel, place);
  Channel channel;
  channel.id = fields.u16("id");
  channel.schema_id = fields.u16("schema_id");
  channel.topic = fields.text("topic");
  channel.message_encoding = fields.text("message_encoding");
  channel.metadata = fields.texts("metadata");
  return channel;
}

template <>
Message decode_as<Message>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kMessage, place);
  Message message;
  message.channel_id = fields.u16("channel_id");
  message.sequence = fields.u32("sequence");
  message.log_time_ns = fields.u64("log_time");
  message.publish_time_ns = fields.u64("publish_time");
  message.data = fields.rest();
  return message;
}

template <>
Chunk decode_as<Chunk>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kChunk, place);
  Chunk chunk = chunk_head(fields);
  chunk.records = fields.take(fields.u64("the length of records"), "records");
  return chunk;
}

Chunk decode_begun_chunk(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kChunk, place);
  Chunk chunk = chunk_head(fields);
  const std::uint64_t length = fields.u64("the length of records");
  chunk.records = fields.rest();
  if (chunk.records.size() > length) {
    chunk.records = chunk.records.first(static_cast<std::size_t>(length));
  }
  return chunk;
}

template <>
MessageIndex decode_as<MessageIndex>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kMessageIndex, place);
  MessageIndex index;
  index.channel_id = fields.u16("channel_id");
  for (Fields entries = fields.list("records"); !entries.is_empty();) {
    const std::uint64_t log_time_ns = entries.u64("log_time");
    index.entries.push_back({.log_time_ns = log_time_ns, .offset = entries.u64("offset")});
  }
  return index;
}

template <>
ChunkIndex decode_as<ChunkIndex>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kChunkIndex, place);
  ChunkIndex index;
  index.message_start_time_ns = fields.u64("message_start_time");
  index.message_end_time_ns = fields.u64("message_end_time");
  index.chunk_start_offset = fields.u64("chunk_start_offset");
  index.chunk_length = fields.u64("chunk_length");
  for (Fields offsets = fields.list("message_index_offsets"); !offsets.is_empty();) {
    const std::uint16_t channel_id = offsets.u16("channel_id");
    index.message_index_offsets.push_back(
        {.channel_id = channel_id, .offset = offsets.u64("offset")});
  }
  index.message_index_length = fields.u64("message_index_length");
  index.compression = fields.text("compression");
  index.compressed_size = fields.u64("compressed_size");
  index.uncompressed_size = fields.u64("uncompressed_size");
  return index;
}

template <>
Attachment decode_as<Attachment>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kAttachment, place);
  Attachment attachment;
  attachment.log_time_ns = fields.u64("log_time");
  attachment.create_time_ns = fields.u64("create_time");
  attachment.name = fields.text("name");
  attachment.media_type = fields.text("media_type");
  attachment.data = fields.take(fields.u64("the length of data"), "data");
  fields.u32("crc");
  return attachment;
}

AttachmentCrc crc_of_attachment(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kAttachment, place);
  fields.u64("log_time");
  fields.u64("create_time");
  fields.take(fields.u32("name"), "name");
  fields.take(fields.u32("media_type"), "media_type");
  fields.take(fields.u64("the length of data"), "data");
  Crc crc;
  crc.add(content.first(content.size() - fields.rest().size()));
  return {.written = fields.u32("crc"), .computed = crc.value()};
}

template <>
AttachmentIndex decode_as<AttachmentIndex>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kAttachmentIndex, place);
  AttachmentIndex index;
  index.offset = fields.u64("offset");
  index.length = fields.u64("length");
  index.log_time_ns = fields.u64("log_time");
  index.create_time_ns = fields.u64("create_time");
  index.data_size = fields.u64("data_size");
  index.name = fields.text("name");
  index.media_type = fields.text("media_type");
  return index;
}

template <>
Statistics decode_as<Statistics>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kStatistics, place);
  Statistics statistics;
  statistics.message_count = fields.u64("message_count");
  statistics.schema_count = fields.u16("schema_count");
  statistics.channel_count = fields.u32("channel_count");
  statistics.attachment_count = fields.u32("attachment_count");
  statistics.metadata_count = fields.u32("metadata_count");
  statistics.chunk_count = fields.u32("chunk_count");
  statistics.message_start_time_ns = fields.u64("message_start_time");
  statistics.message_end_time_ns = fields.u64("message_end_time");
  for (Fields counts = fields.list("channel_message_counts"); !counts.is_empty();) {
    const std::uint16_t channel_id = counts.u16("channel_id");
    if (!statistics.channel_message_counts.emplace(channel_id, counts.u64("count")).second) {
      fields.fail("channel_message_counts with each channel once",
                  fmt::format("channel {} twice", channel_id));
    }
  }
  return statistics;
}

template <>
Metadata decode_as<Metadata>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kMetadata, place);
  Metadata metadata;
  metadata.name = fields.text("name");
  metadata.metadata = fields.texts("metadata");
  return metadata;
}

template <>
MetadataIndex decode_as<MetadataIndex>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kMetadataIndex, place);
  MetadataIndex index;
  index.offset = fields.u64("offset");
  index.length = fields.u64("length");
  index.name = fields.text("name");
  return index;
}

template <>
SummaryOffset decode_as<SummaryOffset>(Bytes content, const Place& place) {
  Fields fields(content, Opcode::kSummaryOffset, place);
  SummaryOffset offset;
  offset.group_opcode = static_cast<Opcode>(fields.number<std::uint8_t>("group_opcode"));
  offset.group_start = fields.u64("group_start");
  offset.group_length = fields.u64("group_length");
  return offset;
}

template <>
DataEnd decode_as<DataEnd>(Bytes content, const Place& place) {
  return {.data_section_crc = Fields(content, Opcode::kDataEnd, place).u32("data_section_crc")};
}

std::optional<Record> decode(Opcode opcode, Bytes content, const Place& place) {
  switch (opcode) {
    case Opcode::kHeader:
      return decode_as<Header>(content, place);
    case Opcode::kFooter:
      return decode_as<Footer>(content, place);
    case Opcode::kSchema:
      return decode_as<Schema>(content, place);
    case Opcode::kChannel:
      return decode_as<Channel>(content, place);
    case Opcode::kMessage:
      return decode_as<Message>(content, place);
    case Opcode::kChunk:
      return decode_as<Chunk>(content, place);
    case Opcode::kMessageIndex:
      return decode_as<MessageIndex>(content, place);
    case Opcode::kChunkIndex:
      return decode_as<ChunkIndex>(content, place);
    case Opcode::kAttachment:
      return decode_as<Attachment>(content, place);
    case Opcode::kAttachmentIndex:
      return decode_as<AttachmentIndex>(content, place);
    case Opcode::kStatistics:
      return decode_as<Statistics>(content, place);
    case Opcode::kMetadata:
      return decode_as<Metadata>(content, place);
    case Opcode::kMetadataIndex:
      return decode_as<MetadataIndex>(content, place);
    case Opcode::kSummaryOffset:
      return decode_as<SummaryOffset>(content, place);
    case Opcode::kDataEnd:
      return decode_as<DataEnd>(content, place);
  }
  return {};
}

std::string shown(std::string_view text) {
  constexpr std::size_t kMost = 60;
  std::string result = "\"";
  for (const char character : text.substr(0, kMost)) {
    const bool is_plain = character >= ' ' && character <= '~' && character != '"';
    result += is_plain ? character : '?';
  }
  return result + (text.size() > kMost ? "…\"" : "\"");
}

}  // namespace fastcycle::mcap

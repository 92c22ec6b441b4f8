#include "mcap/decode.h"

#include <algorithm>
#include <concepts>
#include <map>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "mcap/crc.h"
#include "mcap/encode.h"
#include "mcap/fields.h"

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

/// Reads fields from the beginning of the content of a record, or of a part of it.
class FieldReader {
 public:
  FieldReader(Bytes bytes, Opcode record, const Place& place)
      : rest_(bytes), record_(record), place_(place) {}

  template <std::unsigned_integral Number>
  Number number(const char* name) {
    return load<Number>(take(sizeof(Number), name));
  }
  std::uint32_t u32(const char* name) { return number<std::uint32_t>(name); }
  std::uint64_t u64(const char* name) { return number<std::uint64_t>(name); }

  /// Reads a field.
  template <std::unsigned_integral Number>
  void operator()(const char* name, Number& field) {
    field = number<Number>(name);
  }
  void operator()(const char* name, Opcode& field) {
    field = static_cast<Opcode>(number<std::uint8_t>(name));
  }
  void operator()(const char* name, std::string& field) { field = text_of(take(u32(name), name)); }
  void operator()(const char* name, std::map<std::string, std::string>& field) {
    for (FieldReader entries = list(name); !entries.is_empty();) {
      std::string key;
      std::string value;
      entries("a key", key);
      entries("a value", value);
      if (!field.emplace(std::move(key), std::move(value)).second) {
        fail(fmt::format("{} with each key once", name), "one twice");
      }
    }
  }
  void operator()(const char* name, std::map<std::uint16_t, std::uint64_t>& field) {
    for (FieldReader counts = list(name); !counts.is_empty();) {
      const auto channel_id = counts.number<std::uint16_t>("channel_id");
      if (!field.emplace(channel_id, counts.u64("count")).second) {
        fail(fmt::format("{} with each channel once", name),
             fmt::format("channel {} twice", channel_id));
      }
    }
  }
  template <typename Entry>
  void operator()(const char* name, std::vector<Entry>& field) {
    for (FieldReader entries = list(name); !entries.is_empty();) {
      visit_fields(field.emplace_back(), entries);
    }
  }

  Bytes take(std::uint64_t size, const char* name) {
    if (size > rest_.size()) {
      fail(fmt::format("{} of {} bytes", name, size),
           fmt::format("{} bytes left in the record", rest_.size()));
    }
    const Bytes taken = rest_.first(static_cast<std::size_t>(size));
    rest_ = rest_.subspan(taken.size());
    return taken;
  }

  /// A list or a map, preceded by its length in bytes.
  FieldReader list(const char* name) { return {take(u32(name), name), record_, place_}; }

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

// For records that have only fields.
template <typename Kind>
Kind decode_as(Bytes content, const Place& place) {
  FieldReader fields(content, kOpcodeOf<Kind>, place);
  if (kOpcodeOf<Kind> == Opcode::kFooter && content.size() != kFooterBytes) {
    fields.fail(fmt::format("{} bytes", kFooterBytes), fmt::format("{} bytes", content.size()));
  }
  Kind record;
  visit_fields(record, fields);
  return record;
}

template <>
Message decode_as<Message>(Bytes content, const Place& place) {
  FieldReader fields(content, Opcode::kMessage, place);
  Message message;
  fields("channel_id", message.channel_id);
  fields("sequence", message.sequence);
  fields("log_time", message.log_time_ns);
  fields("publish_time", message.publish_time_ns);
  message.data = fields.rest();
  return message;
}

template <>
Chunk decode_as<Chunk>(Bytes content, const Place& place) {
  FieldReader fields(content, Opcode::kChunk, place);
  Chunk chunk;
  visit_fields(chunk, fields);
  chunk.records = fields.take(fields.u64("the length of records"), "records");
  return chunk;
}

Chunk decode_begun_chunk(Bytes content, const Place& place) {
  FieldReader fields(content, Opcode::kChunk, place);
  Chunk chunk;
  visit_fields(chunk, fields);
  const std::uint64_t length = fields.u64("the length of records");
  chunk.records = fields.rest();
  if (chunk.records.size() > length) {
    chunk.records = chunk.records.first(static_cast<std::size_t>(length));
  }
  return chunk;
}

template <>
Attachment decode_as<Attachment>(Bytes content, const Place& place) {
  FieldReader fields(content, Opcode::kAttachment, place);
  Attachment attachment;
  visit_fields(static_cast<AttachmentHead&>(attachment), fields);
  attachment.data = fields.take(fields.u64("the length of data"), "data");
  fields.u32("crc");
  return attachment;
}

AttachmentCrc crc_of_attachment(Bytes content, const Place& place) {
  FieldReader fields(content, Opcode::kAttachment, place);
  AttachmentHead head;
  visit_fields(head, fields);
  fields.take(fields.u64("the length of data"), "data");
  Crc crc;
  crc.add(content.first(content.size() - fields.rest().size()));
  return {.written = fields.u32("crc"), .computed = crc.value()};
}

template Header decode_as<Header>(Bytes, const Place&);
template Footer decode_as<Footer>(Bytes, const Place&);
template Schema decode_as<Schema>(Bytes, const Place&);
template Channel decode_as<Channel>(Bytes, const Place&);
template MessageIndex decode_as<MessageIndex>(Bytes, const Place&);
template ChunkIndex decode_as<ChunkIndex>(Bytes, const Place&);
template AttachmentIndex decode_as<AttachmentIndex>(Bytes, const Place&);
template Statistics decode_as<Statistics>(Bytes, const Place&);
template Metadata decode_as<Metadata>(Bytes, const Place&);
template MetadataIndex decode_as<MetadataIndex>(Bytes, const Place&);
template SummaryOffset decode_as<SummaryOffset>(Bytes, const Place&);
template DataEnd decode_as<DataEnd>(Bytes, const Place&);

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

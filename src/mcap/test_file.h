#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "mcap/encode.h"
#include "mcap/reader.h"
#include "mcap/record_reader.h"
#include "mcap/writer.h"

/// Helpers for tests: files as strings, records as lines of text.
namespace fastcycle::mcap {

/// Shown in names of tests; by default they would contain uninitialized padding bytes.
inline void PrintTo(const WriterOptions& options, std::ostream* stream) {
  const std::string_view name = name_of(options.chunk.compression);
  *stream << (!options.chunked ? "unchunked"
              : name.empty()   ? "uncompressed"
                               : name)
          << (options.chunk_index ? "" : ", without chunk index");
}

inline const Schema kSpeedSchema{
    .id = 1, .name = "demo.Speed", .encoding = "protobuf", .data = std::string("\x0a\x00\xff", 3)};
inline const Channel kSpeed{.id = 1,
                            .schema_id = 1,
                            .topic = "control/speed",
                            .message_encoding = "protobuf",
                            .metadata = {{"unit", "mps"}}};
inline const Channel kCamera{
    .id = 2, .schema_id = 0, .topic = "camera/front", .message_encoding = "raw", .metadata = {}};

/// A sink that writes to a string.
class StringSink final : public Sink {
 public:
  void append(std::span<const Bytes> parts) override {
    for (const Bytes part : parts) {
      file_ += text_of(part);
    }
  }
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] const std::string& file() const { return file_; }

 private:
  const std::string name_ = "test.mcap";
  std::string file_;
};

inline MessageHead head_at(std::uint64_t log_time_ns, const Channel& channel = kSpeed) {
  return {.channel_id = channel.id,
          .sequence = static_cast<std::uint32_t>(log_time_ns % 1000),
          .log_time_ns = log_time_ns,
          .publish_time_ns = log_time_ns > 0 ? log_time_ns - 1 : 0};
}

inline void write_message(Writer& writer, const MessageHead& head, std::string_view data) {
  writer.write(Message{head, bytes_of(data)});
}

/// Small chunks, so that a small file has several.
inline WriterOptions small_chunks(Compression compression = Compression::kNone) {
  return {.profile = "test",
          .library = "fastcycle",
          .chunk_bytes = 220,
          .chunk = {.compression = compression}};
}

inline WriterOptions without_summary(WriterOptions options) {
  options.repeat_schemas = options.repeat_channels = options.statistics = false;
  options.metadata_index = options.attachment_index = options.chunk_index = false;
  return options;
}

inline WriterOptions without_crcs(WriterOptions options) {
  options.chunk.crc = options.attachment_crc = options.data_crc = options.summary_crc = false;
  return options;
}

/// Two channels, twelve messages not in the order of their times, an attachment, metadata.
inline std::string drive(const WriterOptions& options, bool is_closed = true) {
  StringSink sink;
  Writer writer(sink, options);
  writer.add(kSpeedSchema);
  writer.add(kSpeed);
  for (std::uint64_t i = 0; i < 12; ++i) {
    if (i == 4) {
      writer.add(kCamera);
      const std::string calibration = "f = 1.5";
      writer.write(Attachment{{.log_time_ns = 40, .name = "camera.txt", .media_type = "text/plain"},
                              bytes_of(calibration)});
      writer.write(Metadata{.name = "car", .metadata = {{"name", "demo"}}});
    }
    const bool is_speed = i < 4 || i % 3 != 0;
    // 1 0 3 2 5 4 ...: neighbours are swapped; the camera's have the time of the one before.
    write_message(writer,
                  head_at(is_speed ? (i ^ 1U) * 10 : (i - 1) * 10, is_speed ? kSpeed : kCamera),
                  fmt::format("message number {}, which is not long", i));
  }
  if (is_closed) {
    writer.close();
  } else {
    writer.flush();
  }
  return sink.file();
}

template <typename Map>
std::string line_of_map(const Map& map) {
  std::string line;
  for (const auto& [key, value] : map) {
    line += fmt::format(" {}={}", key, value);
  }
  return line;
}

/// Formats a record on one line.
struct LineOf {
  std::string operator()(const Header& one) const {
    return fmt::format("Header {} {}", one.profile, one.library);
  }
  std::string operator()(const Footer& one) const {
    return fmt::format("Footer {} {} {}", one.summary_start, one.summary_offset_start,
                       one.summary_crc);
  }
  std::string operator()(const Schema& one) const {
    return fmt::format("Schema {} {} {} {}", one.id, one.name, one.encoding, one.data);
  }
  std::string operator()(const Channel& one) const {
    return fmt::format("Channel {} {} {} {}{}", one.id, one.schema_id, one.topic,
                       one.message_encoding, line_of_map(one.metadata));
  }
  std::string operator()(const Message& one) const {
    return fmt::format("Message {} {} {} {} {}", one.channel_id, one.sequence, one.log_time_ns,
                       one.publish_time_ns, text_of(one.data));
  }
  std::string operator()(const Chunk& one) const {
    return fmt::format("Chunk {} {} {}", one.message_start_time_ns, one.message_end_time_ns,
                       one.uncompressed_size);
  }
  std::string operator()(const MessageIndex& one) const {
    std::string line = fmt::format("MessageIndex {}", one.channel_id);
    for (const auto& [log_time_ns, offset] : one.entries) {
      line += fmt::format(" {}@{}", log_time_ns, offset);
    }
    return line;
  }
  std::string operator()(const ChunkIndex& one) const {
    std::string line = fmt::format("ChunkIndex {} {} {} {} {} {} {} {}", one.message_start_time_ns,
                                   one.message_end_time_ns, one.chunk_start_offset,
                                   one.chunk_length, one.message_index_length, one.compression,
                                   one.compressed_size, one.uncompressed_size);
    for (const auto& [channel_id, offset] : one.message_index_offsets) {
      line += fmt::format(" {}={}", channel_id, offset);
    }
    return line;
  }
  std::string operator()(const Attachment& one) const {
    return fmt::format("Attachment {} {} {} {} {}", one.log_time_ns, one.create_time_ns, one.name,
                       one.media_type, text_of(one.data));
  }
  std::string operator()(const AttachmentIndex& one) const {
    return fmt::format("AttachmentIndex {} {} {} {} {} {} {}", one.offset, one.length,
                       one.log_time_ns, one.create_time_ns, one.data_size, one.name,
                       one.media_type);
  }
  std::string operator()(const Statistics& one) const {
    return fmt::format("Statistics {} {} {} {} {} {} {} {}{}", one.message_count, one.schema_count,
                       one.channel_count, one.attachment_count, one.metadata_count, one.chunk_count,
                       one.message_start_time_ns, one.message_end_time_ns,
                       line_of_map(one.channel_message_counts));
  }
  std::string operator()(const Metadata& one) const {
    return fmt::format("Metadata {}{}", one.name, line_of_map(one.metadata));
  }
  std::string operator()(const MetadataIndex& one) const {
    return fmt::format("MetadataIndex {} {} {}", one.offset, one.length, one.name);
  }
  std::string operator()(const SummaryOffset& one) const {
    return fmt::format("SummaryOffset {} {} {}", static_cast<int>(one.group_opcode),
                       one.group_start, one.group_length);
  }
  std::string operator()(const DataEnd& one) const {
    return fmt::format("DataEnd {}", one.data_section_crc);
  }
};

using Lines = std::vector<std::string>;

/// Result of reading a file with `RecordReader`.
struct Streamed {
  Lines lines;
  Stop stop;
};

inline Streamed stream(std::string_view file, const ReadOptions& options = {}) {
  const MemorySource source(bytes_of(file), "test.mcap");
  RecordReader reader(source, options);
  Streamed result;
  while (const std::optional<Record> record = reader.next()) {
    result.lines.push_back(std::visit(LineOf{}, *record));
  }
  result.stop = *reader.stop();
  return result;
}

/// Those lines that begin with `word`.
inline Lines only(const Lines& lines, std::string_view word) {
  Lines result;
  for (const std::string& line : lines) {
    if (line.substr(0, line.find(' ')) == word) {
      result.push_back(line);
    }
  }
  return result;
}

inline Lines messages_of(const Reader& reader, const MessageQuery& query = {}) {
  Lines lines;
  MessageReader messages = reader.messages(query);
  while (const std::optional<StoredMessage> message = messages.next()) {
    lines.push_back(LineOf{}(*message));
  }
  return lines;
}

/// The messages that a `Reader` finds.
inline Lines indexed(std::string_view file, const MessageQuery& query = {},
                     const ReadOptions& options = {}) {
  const MemorySource source(bytes_of(file), "test.mcap");
  return messages_of(Reader(source, options), query);
}

/// Offset of record number `index` of this opcode in the file, outside of chunks.
inline std::size_t find_record(std::string_view file, Opcode opcode, std::size_t index = 0) {
  for (std::size_t at = kMagic.size(); at + kFrameBytes <= file.size();) {
    std::uint64_t length = 0;
    std::memcpy(&length, file.data() + at + 1, sizeof(length));
    if (static_cast<Opcode>(file[at]) == opcode && index-- == 0) {
      return at;
    }
    at += kFrameBytes + static_cast<std::size_t>(length);
  }
  throw std::runtime_error("no such record");
}

/// `file` with `value` written at `offset`.
template <typename Number>
std::string with(std::string file, std::size_t offset, Number value) {
  std::memcpy(file.data() + offset, &value, sizeof(value));
  return file;
}

/// A record of any opcode and content.
inline std::string raw_record(std::uint8_t opcode, std::string_view content) {
  const std::uint64_t length = content.size();
  std::string record(1, static_cast<char>(opcode));
  record.append(reinterpret_cast<const char*>(&length), sizeof(length));
  return record.append(content);
}

template <typename Kind>
std::string encoded(const Kind& record) {
  std::vector<std::byte> bytes;
  encode(record, bytes);
  return std::string(text_of(bytes));
}

inline std::string encoded(const Message& message) {
  const auto bytes = encode_head(message, message.data.size());
  return std::string(text_of(bytes)).append(text_of(message.data));
}

/// A chunk record around records that need not be valid.
inline std::string chunk_around(std::string_view records, Chunk head) {
  std::vector<std::byte> bytes;
  encode_head(head, records.size(), bytes);
  return std::string(text_of(bytes)).append(records);
}

inline std::string magic() {
  return std::string(text_of(kMagic));
}

/// A file of these records, without a summary.
inline std::string file_of(std::string_view records) {
  return magic() + encoded(Header{}) + std::string(records) + encoded(DataEnd{}) +
         encoded(Footer{}) + magic();
}

}  // namespace fastcycle::mcap

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

/// The records of an MCAP file as plain values, one struct for each.
///
/// Times are nanoseconds since the recording's epoch. Offsets and lengths are bytes; offsets count
/// from the beginning of the file, and lengths of records include opcode and length field, unless
/// stated otherwise. `Bytes` are borrowed: functions that return them document how long.
namespace fastcycle::mcap {

using Bytes = std::span<const std::byte>;

/// The bytes of `text`, borrowed.
[[nodiscard]] inline Bytes bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}
/// Total size of `parts`.
[[nodiscard]] inline std::size_t size_of(std::span<const Bytes> parts) {
  std::size_t size = 0;
  for (const Bytes part : parts) {
    size += part.size();
  }
  return size;
}
/// `bytes` as text, borrowed.
[[nodiscard]] inline std::string_view text_of(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Magic bytes at the beginning and at the end of every file.
inline constexpr std::array<std::byte, 8> kMagic{std::byte{0x89}, std::byte{'M'}, std::byte{'C'},
                                                 std::byte{'A'},  std::byte{'P'}, std::byte{'0'},
                                                 std::byte{'\r'}, std::byte{'\n'}};

enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

/// `Message`, `ChunkIndex`; `record of opcode 0x42` for an unknown one.
[[nodiscard]] std::string name_of(Opcode opcode);

struct Header {
  std::string profile = {};  ///< Guarantees to readers beyond the format; may be empty.
  std::string library = {};  ///< The software that wrote the file.

  bool operator==(const Header&) const = default;
};

struct Footer {
  std::uint64_t summary_start = 0;         ///< 0: there is no summary.
  std::uint64_t summary_offset_start = 0;  ///< 0: there are no summary offsets.
  std::uint32_t summary_crc = 0;           ///< 0: not computed.

  bool operator==(const Footer&) const = default;
};

struct Schema {
  std::uint16_t id = 0;       ///< Not 0.
  std::string name = {};      ///< `demo.Speed`
  std::string encoding = {};  ///< `protobuf`
  std::string data = {};      ///< Bytes; for protobuf a serialized `FileDescriptorSet`.

  bool operator==(const Schema&) const = default;
};

struct Channel {
  std::uint16_t id = 0;
  std::uint16_t schema_id = 0;  ///< 0: messages have no schema.
  std::string topic = {};
  std::string message_encoding = {};
  std::map<std::string, std::string> metadata = {};

  bool operator==(const Channel&) const = default;
};

/// The fields of a message record.
struct MessageHead {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;
  std::uint64_t publish_time_ns = 0;

  bool operator==(const MessageHead&) const = default;
};

struct Message : MessageHead {
  Bytes data = {};
};

struct Chunk {
  std::uint64_t message_start_time_ns = 0;  ///< 0 if it has no messages.
  std::uint64_t message_end_time_ns = 0;    ///< Inclusive: time of the latest message.
  std::uint64_t uncompressed_size = 0;
  std::uint32_t uncompressed_crc = 0;  ///< 0: not computed.
  std::string compression = {};        ///< Empty, `lz4` or `zstd`.
  Bytes records = {};                  ///< Compressed.
};

struct MessageIndex {
  struct Entry {
    std::uint64_t log_time_ns = 0;
    std::uint64_t offset = 0;  ///< From the beginning of the uncompressed records.

    bool operator==(const Entry&) const = default;
  };

  std::uint16_t channel_id = 0;
  std::vector<Entry> entries = {};
};

struct ChunkIndex {
  struct MessageIndexOffset {
    std::uint16_t channel_id = 0;
    std::uint64_t offset = 0;

    bool operator==(const MessageIndexOffset&) const = default;
  };

  std::uint64_t message_start_time_ns = 0;
  std::uint64_t message_end_time_ns = 0;
  std::uint64_t chunk_start_offset = 0;
  std::uint64_t chunk_length = 0;
  /// Offsets of the chunk's message indexes, one for each channel with messages in it. Empty: there
  /// are none.
  std::vector<MessageIndexOffset> message_index_offsets = {};
  std::uint64_t message_index_length = 0;  ///< Of all of them.
  std::string compression = {};
  std::uint64_t compressed_size = 0;
  std::uint64_t uncompressed_size = 0;

  bool operator==(const ChunkIndex&) const = default;
};

/// The fields of an attachment record.
struct AttachmentHead {
  std::uint64_t log_time_ns = 0;
  std::uint64_t create_time_ns = 0;  ///< 0: unknown.
  std::string name = {};
  std::string media_type = {};

  bool operator==(const AttachmentHead&) const = default;
};

struct Attachment : AttachmentHead {
  Bytes data = {};
};

struct AttachmentIndex {
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::uint64_t log_time_ns = 0;
  std::uint64_t create_time_ns = 0;
  std::uint64_t data_size = 0;
  std::string name = {};
  std::string media_type = {};

  bool operator==(const AttachmentIndex&) const = default;
};

struct Statistics {
  std::uint64_t message_count = 0;
  std::uint16_t schema_count = 0;
  std::uint32_t channel_count = 0;
  std::uint32_t attachment_count = 0;
  std::uint32_t metadata_count = 0;
  std::uint32_t chunk_count = 0;
  std::uint64_t message_start_time_ns = 0;  ///< 0 if there are no messages.
  std::uint64_t message_end_time_ns = 0;    ///< Inclusive: time of the latest message.
  std::map<std::uint16_t, std::uint64_t> channel_message_counts = {};

  bool operator==(const Statistics&) const = default;
};

struct Metadata {
  std::string name = {};
  std::map<std::string, std::string> metadata = {};

  bool operator==(const Metadata&) const = default;
};

struct MetadataIndex {
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::string name = {};

  bool operator==(const MetadataIndex&) const = default;
};

struct SummaryOffset {
  Opcode group_opcode{};
  std::uint64_t group_start = 0;
  std::uint64_t group_length = 0;

  bool operator==(const SummaryOffset&) const = default;
};

struct DataEnd {
  std::uint32_t data_section_crc = 0;  ///< 0: not computed.

  bool operator==(const DataEnd&) const = default;
};

/// Any record.
using Record = std::variant<Header, Footer, Schema, Channel, Message, Chunk, MessageIndex,
                            ChunkIndex, Attachment, AttachmentIndex, Statistics, Metadata,
                            MetadataIndex, SummaryOffset, DataEnd>;

}  // namespace fastcycle::mcap

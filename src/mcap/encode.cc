#include "mcap/encode.h"

#include <algorithm>
#include <concepts>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#include <fmt/format.h>

namespace fastcycle::mcap {
namespace {

template <std::unsigned_integral Number>
std::byte* store(std::byte* to, Number value) {
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    *to++ = static_cast<std::byte>(value & 0xFFU);
    value = static_cast<Number>(static_cast<std::uint64_t>(value) >> 8U);
  }
  return to;
}

std::uint32_t checked_length(std::size_t length) {
  if (length > std::numeric_limits<std::uint32_t>::max()) {
    throw std::length_error(
        fmt::format("a field of an MCAP record may have 4 GiB, this one has {} bytes", length));
  }
  return static_cast<std::uint32_t>(length);
}

/// Appends fields; writes the length of what it appended at the end of its life.
template <std::unsigned_integral Length>
class Counted {
 public:
  explicit Counted(std::vector<std::byte>& into) : into_(into), begin_(into.size()) {
    into_.resize(begin_ + sizeof(Length));
  }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
  ~Counted() = default;

  void close(std::uint64_t more = 0) {
    const std::uint64_t length = into_.size() - begin_ - sizeof(Length) + more;
    if constexpr (sizeof(Length) == 4) {
      store(into_.data() + begin_, checked_length(length));
    } else {
      store(into_.data() + begin_, length);
    }
  }

 private:
  std::vector<std::byte>& into_;
  const std::size_t begin_;
};

template <std::unsigned_integral Number>
void put(std::vector<std::byte>& into, Number value) {
  into.resize(into.size() + sizeof(Number));
  store(into.data() + into.size() - sizeof(Number), value);
}

void put(std::vector<std::byte>& into, std::string_view text) {
  put(into, checked_length(text.size()));
  const Bytes bytes = bytes_of(text);
  into.insert(into.end(), bytes.begin(), bytes.end());
}

void put(std::vector<std::byte>& into, const std::map<std::string, std::string>& map) {
  Counted<std::uint32_t> length(into);
  for (const auto& [key, value] : map) {
    put(into, std::string_view(key));
    put(into, std::string_view(value));
  }
  length.close();
}

/// The whole record, of fields that are put one after the other.
template <typename... Fields>
void put_record(std::vector<std::byte>& into, Opcode opcode, const Fields&... fields) {
  put(into, static_cast<std::uint8_t>(opcode));
  Counted<std::uint64_t> length(into);
  (put(into, fields), ...);
  length.close();
}

}  // namespace

void encode(const Header& header, std::vector<std::byte>& into) {
  put_record(into, Opcode::kHeader, header.profile, header.library);
}

void encode(const Footer& footer, std::vector<std::byte>& into) {
  put_record(into, Opcode::kFooter, footer.summary_start, footer.summary_offset_start,
             footer.summary_crc);
}

void encode(const Schema& schema, std::vector<std::byte>& into) {
  put_record(into, Opcode::kSchema, schema.id, schema.name, schema.encoding, schema.data);
}

void encode(const Channel& channel, std::vector<std::byte>& into) {
  put_record(into, Opcode::kChannel, channel.id, channel.schema_id, channel.topic,
             channel.message_encoding, channel.metadata);
}

void encode(const MessageIndex& index, std::vector<std::byte>& into) {
  put(into, static_cast<std::uint8_t>(Opcode::kMessageIndex));
  Counted<std::uint64_t> length(into);
  put(into, index.channel_id);
  Counted<std::uint32_t> entries(into);
  for (const MessageIndex::Entry& entry : index.entries) {
    put(into, entry.log_time_ns);
    put(into, entry.offset);
  }
  entries.close();
  length.close();
}

void encode(const ChunkIndex& index, std::vector<std::byte>& into) {
  put(into, static_cast<std::uint8_t>(Opcode::kChunkIndex));
  Counted<std::uint64_t> length(into);
  put(into, index.message_start_time_ns);
  put(into, index.message_end_time_ns);
  put(into, index.chunk_start_offset);
  put(into, index.chunk_length);
  Counted<std::uint32_t> offsets(into);
  for (const auto& [channel_id, offset] : index.message_index_offsets) {
    put(into, channel_id);
    put(into, offset);
  }
  offsets.close();
  put(into, index.message_index_length);
  put(into, index.compression);
  put(into, index.compressed_size);
  put(into, index.uncompressed_size);
  length.close();
}

void encode(const AttachmentIndex& index, std::vector<std::byte>& into) {
  put_record(into, Opcode::kAttachmentIndex, index.offset, index.length, index.log_time_ns,
             index.create_time_ns, index.data_size, index.name, index.media_type);
}

void encode(const Statistics& statistics, std::vector<std::byte>& into) {
  put(into, static_cast<std::uint8_t>(Opcode::kStatistics));
  Counted<std::uint64_t> length(into);
  put(into, statistics.message_count);
  put(into, statistics.schema_count);
  put(into, statistics.channel_count);
  put(into, statistics.attachment_count);
  put(into, statistics.metadata_count);
  put(into, statistics.chunk_count);
  put(into, statistics.message_start_time_ns);
  put(into, statistics.message_end_time_ns);
  Counted<std::uint32_t> counts(into);
  for (const auto& [channel_id, count] : statistics.channel_message_counts) {
    put(into, channel_id);
    put(into, count);
  }
  counts.close();
  length.close();
}

void encode(const Metadata& metadata, std::vector<std::byte>& into) {
  put_record(into, Opcode::kMetadata, metadata.name, metadata.metadata);
}

void encode(const MetadataIndex& index, std::vector<std::byte>& into) {
  put_record(into, Opcode::kMetadataIndex, index.offset, index.length, index.name);
}

void encode(const SummaryOffset& offset, std::vector<std::byte>& into) {
  put_record(into, Opcode::kSummaryOffset, static_cast<std::uint8_t>(offset.group_opcode),
             offset.group_start, offset.group_length);
}

void encode(const DataEnd& end, std::vector<std::byte>& into) {
  put_record(into, Opcode::kDataEnd, end.data_section_crc);
}

std::array<std::byte, kFrameBytes + kMessageHeadBytes> encode_head(const MessageHead& head,
                                                                   std::uint64_t data_size) {
  std::array<std::byte, kFrameBytes + kMessageHeadBytes> bytes{};
  std::byte* to = store(bytes.data(), static_cast<std::uint8_t>(Opcode::kMessage));
  to = store(to, kMessageHeadBytes + data_size);
  to = store(to, head.channel_id);
  to = store(to, head.sequence);
  to = store(to, head.log_time_ns);
  store(to, head.publish_time_ns);
  return bytes;
}

void encode_head(const Chunk& chunk, std::uint64_t records_size, std::vector<std::byte>& into) {
  put(into, static_cast<std::uint8_t>(Opcode::kChunk));
  Counted<std::uint64_t> length(into);
  put(into, chunk.message_start_time_ns);
  put(into, chunk.message_end_time_ns);
  put(into, chunk.uncompressed_size);
  put(into, chunk.uncompressed_crc);
  put(into, chunk.compression);
  put(into, records_size);
  length.close(records_size);
}

void encode_head(const AttachmentHead& head, std::uint64_t data_size,
                 std::vector<std::byte>& into) {
  put(into, static_cast<std::uint8_t>(Opcode::kAttachment));
  Counted<std::uint64_t> length(into);
  put(into, head.log_time_ns);
  put(into, head.create_time_ns);
  put(into, head.name);
  put(into, head.media_type);
  put(into, data_size);
  length.close(data_size + sizeof(std::uint32_t));
}

std::array<std::byte, 4> encode_u32(std::uint32_t value) {
  std::array<std::byte, 4> bytes{};
  store(bytes.data(), value);
  return bytes;
}

}  // namespace fastcycle::mcap

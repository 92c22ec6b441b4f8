#include <optional>
#include <string>
#include <type_traits>
#include <variant>

#include "conformance.h"
#include "mcap/error.h"
#include "mcap/record_reader.h"

namespace fastcycle::conformance {
namespace {

using Json = nlohmann::json;

Json number(std::uint64_t value) {
  return std::to_string(value);
}

Json bytes(mcap::Bytes data) {
  Json list = Json::array();
  for (const std::byte byte : data) {
    list.push_back(std::to_string(std::to_integer<unsigned>(byte)));
  }
  return list;
}

Json texts(const std::map<std::string, std::string>& map) {
  Json object = Json::object();
  for (const auto& [key, value] : map) {
    object[key] = value;
  }
  return object;
}

/// A record, of names and values in turn.
template <typename... Fields>
Json record_of(const char* type, const Fields&... fields) {
  return {{"type", type}, {"fields", Json::array({fields...})}};
}

Json field(const char* name, Json value) {
  return Json::array({name, std::move(value)});
}

Json describe(const mcap::Header& header) {
  return record_of("Header", field("library", header.library), field("profile", header.profile));
}

Json describe(const mcap::Footer& footer) {
  return record_of("Footer", field("summary_crc", number(footer.summary_crc)),
                   field("summary_offset_start", number(footer.summary_offset_start)),
                   field("summary_start", number(footer.summary_start)));
}

Json describe(const mcap::Schema& schema) {
  return record_of("Schema", field("data", bytes(mcap::bytes_of(schema.data))),
                   field("encoding", schema.encoding), field("id", number(schema.id)),
                   field("name", schema.name));
}

Json describe(const mcap::Channel& channel) {
  return record_of("Channel", field("id", number(channel.id)),
                   field("message_encoding", channel.message_encoding),
                   field("metadata", texts(channel.metadata)),
                   field("schema_id", number(channel.schema_id)), field("topic", channel.topic));
}

Json describe(const mcap::Message& message) {
  return record_of("Message", field("channel_id", number(message.channel_id)),
                   field("data", bytes(message.data)),
                   field("log_time", number(message.log_time_ns)),
                   field("publish_time", number(message.publish_time_ns)),
                   field("sequence", number(message.sequence)));
}

Json describe(const mcap::ChunkIndex& index) {
  Json offsets = Json::object();
  for (const auto& [channel_id, offset] : index.message_index_offsets) {
    offsets[std::to_string(channel_id)] = number(offset);
  }
  return record_of("ChunkIndex", field("chunk_length", number(index.chunk_length)),
                   field("chunk_start_offset", number(index.chunk_start_offset)),
                   field("compressed_size", number(index.compressed_size)),
                   field("compression", index.compression),
                   field("message_end_time", number(index.message_end_time_ns)),
                   field("message_index_length", number(index.message_index_length)),
                   field("message_index_offsets", offsets),
                   field("message_start_time", number(index.message_start_time_ns)),
                   field("uncompressed_size", number(index.uncompressed_size)));
}

Json describe(const mcap::Attachment& attachment) {
  return record_of("Attachment", field("create_time", number(attachment.create_time_ns)),
                   field("data", bytes(attachment.data)),
                   field("log_time", number(attachment.log_time_ns)),
                   field("media_type", attachment.media_type), field("name", attachment.name));
}

Json describe(const mcap::AttachmentIndex& index) {
  return record_of(
      "AttachmentIndex", field("create_time", number(index.create_time_ns)),
      field("data_size", number(index.data_size)), field("length", number(index.length)),
      field("log_time", number(index.log_time_ns)), field("media_type", index.media_type),
      field("name", index.name), field("offset", number(index.offset)));
}

Json describe(const mcap::Statistics& statistics) {
  Json counts = Json::object();
  for (const auto& [channel_id, count] : statistics.channel_message_counts) {
    counts[std::to_string(channel_id)] = number(count);
  }
  return record_of("Statistics", field("attachment_count", number(statistics.attachment_count)),
                   field("channel_count", number(statistics.channel_count)),
                   field("channel_message_counts", counts),
                   field("chunk_count", number(statistics.chunk_count)),
                   field("message_count", number(statistics.message_count)),
                   field("message_end_time", number(statistics.message_end_time_ns)),
                   field("message_start_time", number(statistics.message_start_time_ns)),
                   field("metadata_count", number(statistics.metadata_count)),
                   field("schema_count", number(statistics.schema_count)));
}

Json describe(const mcap::Metadata& metadata) {
  return record_of("Metadata", field("metadata", texts(metadata.metadata)),
                   field("name", metadata.name));
}

Json describe(const mcap::MetadataIndex& index) {
  return record_of("MetadataIndex", field("length", number(index.length)),
                   field("name", index.name), field("offset", number(index.offset)));
}

Json describe(const mcap::SummaryOffset& offset) {
  return record_of("SummaryOffset", field("group_length", number(offset.group_length)),
                   field("group_opcode", number(static_cast<std::uint64_t>(offset.group_opcode))),
                   field("group_start", number(offset.group_start)));
}

Json describe(const mcap::DataEnd& end) {
  return record_of("DataEnd", field("data_section_crc", number(end.data_section_crc)));
}

}  // namespace

Json read_records(const mcap::Source& source) {
  Json records = Json::array();
  mcap::RecordReader reader(source);
  while (const std::optional<mcap::Record> record = reader.next()) {
    std::visit(
        [&]<typename Kind>(const Kind& one) {
          if constexpr (!std::is_same_v<Kind, mcap::Chunk> &&
                        !std::is_same_v<Kind, mcap::MessageIndex>) {
            records.push_back(describe(one));
          }
        },
        *record);
  }
  if (reader.stop()->reason != mcap::Stop::Reason::kEnd) {
    throw mcap::Error(reader.stop()->problem);
  }
  return records;
}

}  // namespace fastcycle::conformance

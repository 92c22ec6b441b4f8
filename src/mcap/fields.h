#pragma once

#include <concepts>
#include <type_traits>

#include "mcap/records.h"

/// The fields of the records, each in the order of the format: defined once, for reading and
/// writing.
namespace fastcycle::mcap {

/// A `Kind`, const for reading or mutable for writing.
template <typename T, typename Kind>
concept Any = std::same_as<std::remove_const_t<T>, Kind>;

/// The opcode of records that have only fields.
template <typename Kind>
inline constexpr Opcode kOpcodeOf{};
template <>
inline constexpr Opcode kOpcodeOf<Header> = Opcode::kHeader;
template <>
inline constexpr Opcode kOpcodeOf<Footer> = Opcode::kFooter;
template <>
inline constexpr Opcode kOpcodeOf<Schema> = Opcode::kSchema;
template <>
inline constexpr Opcode kOpcodeOf<Channel> = Opcode::kChannel;
template <>
inline constexpr Opcode kOpcodeOf<MessageIndex> = Opcode::kMessageIndex;
template <>
inline constexpr Opcode kOpcodeOf<ChunkIndex> = Opcode::kChunkIndex;
template <>
inline constexpr Opcode kOpcodeOf<AttachmentIndex> = Opcode::kAttachmentIndex;
template <>
inline constexpr Opcode kOpcodeOf<Statistics> = Opcode::kStatistics;
template <>
inline constexpr Opcode kOpcodeOf<Metadata> = Opcode::kMetadata;
template <>
inline constexpr Opcode kOpcodeOf<MetadataIndex> = Opcode::kMetadataIndex;
template <>
inline constexpr Opcode kOpcodeOf<SummaryOffset> = Opcode::kSummaryOffset;
template <>
inline constexpr Opcode kOpcodeOf<DataEnd> = Opcode::kDataEnd;

/// Calls `visit(name, field)` for each field of a record. Of chunk and attachment these are the
/// fields before their data.
void visit_fields(Any<Header> auto& header, auto& visit) {
  visit("profile", header.profile);
  visit("library", header.library);
}

void visit_fields(Any<Footer> auto& footer, auto& visit) {
  visit("summary_start", footer.summary_start);
  visit("summary_offset_start", footer.summary_offset_start);
  visit("summary_crc", footer.summary_crc);
}

void visit_fields(Any<Schema> auto& schema, auto& visit) {
  visit("id", schema.id);
  visit("name", schema.name);
  visit("encoding", schema.encoding);
  visit("data", schema.data);
}

void visit_fields(Any<Channel> auto& channel, auto& visit) {
  visit("id", channel.id);
  visit("schema_id", channel.schema_id);
  visit("topic", channel.topic);
  visit("message_encoding", channel.message_encoding);
  visit("metadata", channel.metadata);
}

void visit_fields(Any<Chunk> auto& chunk, auto& visit) {
  visit("message_start_time", chunk.message_start_time_ns);
  visit("message_end_time", chunk.message_end_time_ns);
  visit("uncompressed_size", chunk.uncompressed_size);
  visit("uncompressed_crc", chunk.uncompressed_crc);
  visit("compression", chunk.compression);
}

void visit_fields(Any<MessageIndex> auto& index, auto& visit) {
  visit("channel_id", index.channel_id);
  visit("records", index.entries);
}

void visit_fields(Any<MessageIndex::Entry> auto& entry, auto& visit) {
  visit("log_time", entry.log_time_ns);
  visit("offset", entry.offset);
}

void visit_fields(Any<ChunkIndex> auto& index, auto& visit) {
  visit("message_start_time", index.message_start_time_ns);
  visit("message_end_time", index.message_end_time_ns);
  visit("chunk_start_offset", index.chunk_start_offset);
  visit("chunk_length", index.chunk_length);
  visit("message_index_offsets", index.message_index_offsets);
  visit("message_index_length", index.message_index_length);
  visit("compression", index.compression);
  visit("compressed_size", index.compressed_size);
  visit("uncompressed_size", index.uncompressed_size);
}

void visit_fields(Any<ChunkIndex::MessageIndexOffset> auto& index, auto& visit) {
  visit("channel_id", index.channel_id);
  visit("offset", index.offset);
}

void visit_fields(Any<AttachmentHead> auto& attachment, auto& visit) {
  visit("log_time", attachment.log_time_ns);
  visit("create_time", attachment.create_time_ns);
  visit("name", attachment.name);
  visit("media_type", attachment.media_type);
}

void visit_fields(Any<AttachmentIndex> auto& index, auto& visit) {
  visit("offset", index.offset);
  visit("length", index.length);
  visit("log_time", index.log_time_ns);
  visit("create_time", index.create_time_ns);
  visit("data_size", index.data_size);
  visit("name", index.name);
  visit("media_type", index.media_type);
}

void visit_fields(Any<Statistics> auto& statistics, auto& visit) {
  visit("message_count", statistics.message_count);
  visit("schema_count", statistics.schema_count);
  visit("channel_count", statistics.channel_count);
  visit("attachment_count", statistics.attachment_count);
  visit("metadata_count", statistics.metadata_count);
  visit("chunk_count", statistics.chunk_count);
  visit("message_start_time", statistics.message_start_time_ns);
  visit("message_end_time", statistics.message_end_time_ns);
  visit("channel_message_counts", statistics.channel_message_counts);
}

void visit_fields(Any<Metadata> auto& metadata, auto& visit) {
  visit("name", metadata.name);
  visit("metadata", metadata.metadata);
}

void visit_fields(Any<MetadataIndex> auto& index, auto& visit) {
  visit("offset", index.offset);
  visit("length", index.length);
  visit("name", index.name);
}

void visit_fields(Any<SummaryOffset> auto& offset, auto& visit) {
  visit("group_opcode", offset.group_opcode);
  visit("group_start", offset.group_start);
  visit("group_length", offset.group_length);
}

void visit_fields(Any<DataEnd> auto& end, auto& visit) {
  visit("data_section_crc", end.data_section_crc);
}

}  // namespace fastcycle::mcap

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mcap/chunk_builder.h"
#include "mcap/crc.h"
#include "mcap/definitions.h"
#include "mcap/file.h"
#include "mcap/records.h"

namespace fastcycle::mcap {

/// The optional parts of a file. The defaults are what readers need to find anything without
/// reading everything.
struct WriterOptions {
  std::string profile = {};  ///< Of the header.
  std::string library = {};  ///< Of the header.

  bool chunked = true;  ///< Messages are in chunks.
  /// Uncompressed size of a chunk; a larger message has a chunk of its own.
  std::uint64_t chunk_bytes = std::uint64_t{1} << 20U;
  ChunkOptions chunk = {};    ///< Of the writer's own chunks.
  bool message_index = true;  ///< After each chunk: where its messages are.

  bool attachment_crc = true;
  bool data_crc = true;  ///< Over everything before the summary.
  bool summary_crc = true;

  // Parts of the summary.
  bool repeat_schemas = true;
  bool repeat_channels = true;
  bool statistics = true;
  bool metadata_index = true;
  bool attachment_index = true;
  bool chunk_index = true;
  bool summary_offsets = true;  ///< Where each of these parts is.
};

/// Writes an MCAP file sequentially to a sink.
///
///     Writer writer(sink, {.library = "fastcycle"});
///     writer.add(schema);
///     writer.add(channel);
///     writer.write({.channel_id = 1, .log_time_ns = now_ns, .publish_time_ns = then_ns}, parts);
///     writer.close();
///
/// Without `close()`, the file is incomplete: readers find everything up to the last complete
/// chunk.
///
/// Memory: the open chunk; all schemas and channels; and the indexes of the summary
/// (`index_bytes()`): about 85 bytes a chunk and 10 for each channel in it, about 60 bytes and the
/// names for an attachment, 29 and the name for metadata.
///
/// @threads  Confined to one thread.
/// @errors   `Error` for a record that the format forbids; nothing was written then, and writing
///           may continue. `Error` of the sink; then the file stays as it is, and all further
///           writes fail. `std::length_error`: a text is over 4 GiB.
class Writer {
 public:
  /// Writes magic and header.
  explicit Writer(Sink& sink, WriterOptions options = {});
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  ~Writer() = default;

  /// Defines a schema (its id is not 0), or a channel of a schema that was added before. Adding it
  /// again with the same content has no effect.
  void add(const Schema& schema);
  void add(const Channel& channel);

  /// Writes a message of a channel that was added. Its data is the concatenation of `data`. Without
  /// chunks the parts go to the sink as they are.
  void write(const MessageHead& head, std::span<const Bytes> data);
  void write(const Message& message) { write(message, {&message.data, 1}); }

  /// Appends a chunk that was built elsewhere, closing it if it is not. The writer's own open chunk
  /// is written before.
  ///
  /// @errors  See above; forbidden without `chunked`, and with messages of channels that are
  /// defined
  ///          neither in the writer nor earlier in the chunk.
  void write(ChunkBuilder& chunk);

  /// Attachments and metadata are outside of chunks, before the open one.
  void write(const AttachmentHead& head, std::span<const Bytes> data);
  void write(const Attachment& attachment) { write(attachment, {&attachment.data, 1}); }
  void write(const Metadata& metadata);

  /// Writes the open chunk: its messages then survive a crash of the process.
  void flush();

  /// Writes all that is left, and the summary. The sink may be destroyed afterwards.
  void close();

  /// Size of the file so far, without the open chunk, in bytes.
  [[nodiscard]] std::uint64_t size() const { return size_; }
  /// Statistics of the file so far, without the open chunk.
  [[nodiscard]] const Statistics& statistics() const { return statistics_; }
  /// Size of the indexes, here and later in the summary.
  [[nodiscard]] std::uint64_t index_bytes() const;
  [[nodiscard]] const Definitions& definitions() const { return definitions_; }

 private:
  using Buffer = std::vector<std::byte>;

  /// Throws unless records can be written; also at `place()` for what the format forbids.
  void require_open(Opcode record) const;
  [[noreturn]] void refuse(Opcode record, std::string expected, std::string found) const;
  [[nodiscard]] Place place() const { return {.file = sink_.name(), .offset = size_}; }

  void put(std::span<const Bytes> parts);
  void add_to_crc(std::span<const Bytes> parts);
  void append(std::span<const Bytes> parts);
  void append(Bytes part) { append({&part, 1}); }

  template <typename Kind>
  void add_new(const Kind& definition);
  void check(const Schema& schema, const Definitions& more) const;
  void check(const Channel& channel, const Definitions& more) const;
  void define(const Schema& schema);
  void define(const Channel& channel);
  void check_channels_of(const ChunkBuilder& chunk) const;
  void append_chunk(ChunkBuilder& chunk);
  void append_message_indexes(const ChunkBuilder& chunk, ChunkIndex& index);
  void count_message(const MessageHead& head);
  void count_chunk(const ChunkBuilder& chunk);
  void count_times(std::uint64_t first_ns, std::uint64_t last_ns);
  void append_summary();

  // Constant after construction.
  Sink& sink_;
  const WriterOptions options_;

  bool is_closed_ = false;
  bool has_failed_ = false;
  std::uint64_t size_ = 0;
  Crc data_crc_;
  Definitions definitions_;
  Statistics statistics_;
  ChunkBuilder chunk_;

  // Encoded records of the summary.
  Buffer chunk_indexes_;
  Buffer attachment_indexes_;
  Buffer metadata_indexes_;

  Buffer scratch_;
  std::vector<Bytes> parts_;
};

}  // namespace fastcycle::mcap

#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <variant>
#include <vector>

#include "mcap/compression.h"
#include "mcap/records.h"

namespace fastcycle::mcap {

struct ChunkOptions {
  Compression compression = Compression::kNone;
  int level = 0;  ///< See `Compressor::compress`.
  bool crc = true;
};

/// A chunk that is built outside of a file, and appended by `Writer::write` when it is complete.
///
///     ChunkBuilder chunk({.compression = Compression::kZstd});
///     chunk.add(head, parts);       // as messages come
///     chunk.close();                // compresses; here, or on another thread
///     writer.write(chunk);
///     chunk.clear();                // for the next one
///
/// A channel has to be defined in the file before its first message: by the writer, or earlier in
/// this chunk.
///
/// Memory: the records, 16 bytes a message, and, once it is closed, the compressed records.
///
/// @threads  Confined; it may be handed from one thread to another.
class ChunkBuilder {
 public:
  struct Definition {
    std::variant<Schema, Channel> record;
    std::uint64_t offset = 0;  ///< From the beginning of the uncompressed records.
  };

  explicit ChunkBuilder(ChunkOptions options = {}) : options_(options) {}

  /// Adds a record. The data of a message is the concatenation of `data`; it is copied.
  ///
  /// @pre     It is not closed.
  /// @errors  `std::length_error` beyond 2^28 messages of a channel, or for texts over 4 GiB.
  void add(const Schema& schema);
  void add(const Channel& channel);
  void add(const MessageHead& head, std::span<const Bytes> data);
  void add(const Message& message) { add(message, {&message.data, 1}); }

  /// Adds a message whose data is not copied: it has to stay unchanged until this chunk was
  /// appended and cleared. Meant for large messages, best in a chunk of their own, uncompressed.
  void borrow(const MessageHead& head, std::span<const Bytes> data);

  /// Computes the CRC and compresses, which is most of the cost of a chunk.
  void close();

  /// Removes all records, but keeps the memory for the next chunk.
  void clear();

  [[nodiscard]] bool is_closed() const { return is_closed_; }
  [[nodiscard]] bool is_empty() const { return size_ == 0; }
  /// Size of the records so far, uncompressed, in bytes.
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] std::uint64_t message_count() const { return message_count_; }

  /// The fields of the chunk record; its `records` are empty, see `parts()`.
  ///
  /// @pre  It is closed.
  [[nodiscard]] const Chunk& head() const;
  /// The records as written to the file, to be concatenated.
  ///
  /// @pre  It is closed.
  [[nodiscard]] std::span<const Bytes> parts() const;
  /// The size of all `parts()`.
  [[nodiscard]] std::uint64_t compressed_size() const;
  /// The CRC of all `parts()`, so that the writer need not read them again; none without
  /// `ChunkOptions::crc`.
  ///
  /// @pre  It is closed.
  [[nodiscard]] std::optional<std::uint32_t> compressed_crc() const;

  /// One for each channel with messages, in the order of their first messages.
  [[nodiscard]] std::span<const MessageIndex> message_indexes() const { return indexes_; }
  /// The schemas and channels, in the order in which they were added.
  [[nodiscard]] std::span<const Definition> definitions() const { return definitions_; }

 private:
  /// A run of the records: in `own_` from `offset` on, or borrowed.
  struct Run {
    const std::byte* borrowed = nullptr;
    std::size_t offset = 0;
    std::size_t size = 0;
  };

  void add_head(const MessageHead& head, std::uint64_t data_size);
  void grew(std::size_t own_size_before);
  void gather();

  // Constant after construction.
  const ChunkOptions options_;

  bool is_closed_ = false;
  std::uint64_t size_ = 0;
  std::uint64_t message_count_ = 0;
  std::vector<std::byte> own_;
  std::vector<Run> runs_;
  std::vector<MessageIndex> indexes_;
  std::unordered_map<std::uint16_t, std::size_t> index_of_channel_;
  std::vector<Definition> definitions_;

  // Since `close()`.
  Chunk head_;
  std::vector<Bytes> parts_;
  std::vector<std::byte> compressed_;
  std::uint64_t compressed_size_ = 0;
  std::optional<std::uint32_t> compressed_crc_;
  Compressor compressor_;
};

}  // namespace fastcycle::mcap

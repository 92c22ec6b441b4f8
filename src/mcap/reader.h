#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mcap/compression.h"
#include "mcap/definitions.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/record_reader.h"
#include "mcap/records.h"

namespace fastcycle::mcap {

class MessageReader;

/// Selects messages.
struct MessageQuery {
  std::vector<std::string> topics = {};      ///< Empty: all.
  std::uint64_t begin_ns = 0;                ///< Log time of the earliest one.
  std::optional<std::uint64_t> end_ns = {};  ///< Exclusive end of log times; none: no end.
  /// Topics whose messages describe the others in their chunk: from each chunk that is opened for
  /// those, they are returned first, whatever their times are.
  std::vector<std::string> heads = {};
};

/// A message with its channel.
struct StoredMessage : Message {
  const Channel* channel = nullptr;  ///< Lives as long as the `Reader`.
};

/// Random access to an MCAP file by its summary: messages by topic and time, attachments, metadata.
///
///     const Reader reader(source);
///     MessageReader messages = reader.messages({.topics = {"control/speed"}});
///     while (const std::optional<StoredMessage> message = messages.next()) { ... }
///
/// A file without a summary, or with one that lacks what is needed, is read once from its beginning
/// to its end (`was_scanned()`), with all the checks of `RecordReader`. This also reads a file that
/// was not closed; `problem()` then reports where it ends. With `ReadOptions::use_summary` off, it
/// reads a file whose summary is damaged.
///
/// With a summary, only the requested parts are read and checked; use `RecordReader` to check a
/// whole file.
///
/// Memory: schemas, channels and indexes; limited by `ReadLimits`.
///
/// @threads  Compatible.
class Reader {
 public:
  /// `source` has to outlive this.
  ///
  /// @errors  `Damage` if a summary that is used is wrong, or, in a scan, something before the end
  ///          of the data section. `Error` if the source cannot be read.
  explicit Reader(const Source& source, ReadOptions options = {});
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  ~Reader();

  /// The messages selected by `query`, in the order of their log times, then of the file. Must not
  /// outlive this reader.
  [[nodiscard]] MessageReader messages(MessageQuery query = {}) const;

  [[nodiscard]] const Header& header() const { return header_; }
  [[nodiscard]] const Definitions& definitions() const { return definitions_; }
  /// Those of the file, or computed by a scan: always set.
  [[nodiscard]] const std::optional<Statistics>& statistics() const { return statistics_; }

  [[nodiscard]] const std::vector<AttachmentIndex>& attachments() const { return attachments_; }
  [[nodiscard]] const std::vector<MetadataIndex>& metadata() const { return metadata_; }
  /// The record at `index`. The attachment's data is in `memory`, which is overwritten.
  ///
  /// @errors  `Damage` if another record is there, or its CRC is wrong.
  [[nodiscard]] Attachment read(const AttachmentIndex& index, std::vector<std::byte>& memory) const;
  [[nodiscard]] Metadata read(const MetadataIndex& index) const;

  [[nodiscard]] bool was_scanned() const { return was_scanned_; }
  /// A problem after the readable data: a file that was not closed, or a damaged summary that was
  /// not needed. None for a valid file.
  [[nodiscard]] const std::optional<Problem>& problem() const { return problem_; }

 private:
  friend class MessageReader;

  /// Contiguous records: in a chunk, or in the file itself.
  struct Span {
    std::uint64_t begin_ns = 0;
    std::uint64_t end_ns = 0;  ///< Of the latest message.
    std::uint64_t offset = 0;
    std::uint64_t length = 0;
    std::uint64_t uncompressed_size = 0;
    bool is_chunk = true;
    std::string compression = {};
    std::vector<std::uint16_t> channel_ids = {};  ///< Sorted. Empty: unknown.
  };

  struct Scan;

  [[nodiscard]] bool read_summary();
  [[nodiscard]] std::optional<Footer> find_footer() const;
  void parse_summary(const Footer& footer, std::uint64_t end);
  void take_summary_record(const Record& record, const Place& place);
  [[nodiscard]] bool is_enough() const;
  void check_spans(std::uint64_t end) const;
  void read_header();
  void scan();
  [[nodiscard]] std::vector<std::byte> read_record(Opcode opcode, std::uint64_t offset,
                                                   std::uint64_t length) const;

  // Constant after construction.
  const Source& source_;
  const ReadOptions options_;
  Header header_;
  Definitions definitions_;
  std::optional<Statistics> statistics_;
  std::vector<Span> spans_;  // In the order of the file.
  std::vector<AttachmentIndex> attachments_;
  std::vector<MetadataIndex> metadata_;
  std::optional<Problem> problem_;
  bool was_scanned_ = false;
};

/// Iterates over messages of a file. Returned by `Reader::messages`.
///
/// A chunk is read when its first message may be next, and freed after its last.
///
/// Memory: the chunks whose times overlap, and 16 bytes for each selected message in them; at most
/// `ReadLimits::open_chunk_bytes` of chunks, else `next` throws.
///
/// @threads  Confined.
class MessageReader {
 public:
  MessageReader(MessageReader&&) noexcept;
  MessageReader& operator=(MessageReader&&) = delete;
  ~MessageReader();

  /// The next message; its data is valid until the next call. None if there is no further one.
  ///
  /// @errors  `Damage` if a chunk is damaged or contradicts the summary. `Error` if the source
  ///          cannot be read. The reader is unusable afterwards.
  std::optional<StoredMessage> next();

 private:
  friend class Reader;
  MessageReader(const Reader& reader, MessageQuery query);

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace fastcycle::mcap

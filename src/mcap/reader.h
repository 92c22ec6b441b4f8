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

/// Which messages are asked for.
struct MessageQuery {
  std::vector<std::string> topics = {};      ///< Empty: all.
  std::uint64_t begin_ns = 0;                ///< Log time of the earliest one.
  std::optional<std::uint64_t> end_ns = {};  ///< Log time that all are before; none: no end.
  /// Topics whose messages tell of the others in their chunk: from each chunk that is opened for
  /// those, they are given first, whatever their times are.
  std::vector<std::string> heads = {};
};

/// A message, with the channel it is of.
struct StoredMessage : Message {
  const Channel* channel = nullptr;  ///< Lives as long as the `Reader`.
};

/// Finds things in an MCAP file by its summary: messages by topic and time, attachments, metadata.
///
///     const Reader reader(source);
///     MessageReader messages = reader.messages({.topics = {"control/speed"}});
///     while (const std::optional<StoredMessage> message = messages.next()) { ... }
///
/// A file without a summary, or with one that lacks what is needed, is read once from its beginning
/// to its end (`was_scanned()`), which checks everything that `RecordReader` checks. This is also
/// how a file is read that was not closed; `problem()` then says where it ends. With
/// `ReadOptions::use_summary` off, a file whose summary is damaged can be read in this way.
///
/// By the summary, only the parts that are asked for are read and checked: a whole check of a file
/// is one by `RecordReader`.
///
/// Memory: schemas, channels and indexes; `ReadLimits` are their bounds.
///
/// @threads  Compatible.
class Reader {
 public:
  /// `source` has to live as long as this.
  ///
  /// @errors  `Damage` if a summary that is used is wrong, or, in a scan, something before the end
  ///          of the data section. `Error` if the source cannot be read.
  explicit Reader(const Source& source, ReadOptions options = {});
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  ~Reader();

  /// The messages that `query` asks for, in the order of their log times; those of the same time in
  /// the order of the file. Valid as long as this reader.
  [[nodiscard]] MessageReader messages(MessageQuery query = {}) const;

  [[nodiscard]] const Header& header() const { return header_; }
  [[nodiscard]] const Definitions& definitions() const { return definitions_; }
  /// Those of the file, or what a scan counted: always there.
  [[nodiscard]] const std::optional<Statistics>& statistics() const { return statistics_; }

  [[nodiscard]] const std::vector<AttachmentIndex>& attachments() const { return attachments_; }
  [[nodiscard]] const std::vector<MetadataIndex>& metadata() const { return metadata_; }
  /// The record that `index` names. The attachment's data is in `memory`, which is overwritten.
  ///
  /// @errors  `Damage` if it is another one, or its CRC is wrong.
  [[nodiscard]] Attachment read(const AttachmentIndex& index, std::vector<std::byte>& memory) const;
  [[nodiscard]] Metadata read(const MetadataIndex& index) const;

  [[nodiscard]] bool was_scanned() const { return was_scanned_; }
  /// What is wrong behind the data that can be read: a file that was not closed, a damaged summary
  /// that was not needed. None for a file in order.
  [[nodiscard]] const std::optional<Problem>& problem() const { return problem_; }

 private:
  friend class MessageReader;

  /// Records that stand one after the other: in a chunk, or in the file itself.
  struct Span {
    std::uint64_t begin_ns = 0;
    std::uint64_t end_ns = 0;  ///< Of the latest message.
    std::uint64_t offset = 0;
    std::uint64_t length = 0;
    std::uint64_t uncompressed_size = 0;
    bool is_chunk = true;
    std::string compression = {};
    std::vector<std::uint16_t> channel_ids = {};  ///< Sorted. Empty: not known.
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

/// Messages of a file, one after the other. Made by `Reader::messages`.
///
/// A chunk is read when its first message may be next, and forgotten after its last.
///
/// Memory: the chunks whose times overlap, and 16 bytes for each message in them that was asked
/// for; at most `ReadLimits::open_chunk_bytes` of chunks, else `next` throws.
///
/// @threads  Confined.
class MessageReader {
 public:
  MessageReader(MessageReader&&) noexcept;
  MessageReader& operator=(MessageReader&&) = delete;
  ~MessageReader();

  /// The next message; its data is valid until the next call. None if there is no further one.
  ///
  /// @errors  `Damage` if a chunk is, or is not what the summary says. `Error` if the source cannot
  /// be
  ///          read. The reader is of no use afterwards.
  std::optional<StoredMessage> next();

 private:
  friend class Reader;
  MessageReader(const Reader& reader, MessageQuery query);

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace fastcycle::mcap

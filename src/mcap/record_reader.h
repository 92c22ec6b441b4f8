#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mcap/compression.h"
#include "mcap/crc.h"
#include "mcap/definitions.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/records.h"

namespace fastcycle::mcap {

/// Limits on the memory that a file can make a reader use, in bytes. Length fields are checked
/// against these limits and the available data before memory is allocated.
struct ReadLimits {
  /// A message, attachment, chunk (compressed) or message index.
  std::uint64_t record_bytes = std::uint64_t{1} << 30U;
  /// Any other record, such as a schema or metadata.
  std::uint64_t small_record_bytes = std::uint64_t{16} << 20U;
  /// The records of a chunk, uncompressed.
  std::uint64_t chunk_bytes = std::uint64_t{512} << 20U;
  /// All different schemas and channels together.
  std::uint64_t definition_bytes = std::uint64_t{256} << 20U;
  /// `Reader` only: the summary; without one, the index built by a scan.
  std::uint64_t index_bytes = std::uint64_t{256} << 20U;
  /// `Reader` only: uncompressed chunks whose times overlap, held at the same time.
  std::uint64_t open_chunk_bytes = std::uint64_t{1} << 30U;
};

/// The largest message that readers accept with these limits. It needs a chunk of its own, with
/// room for its headers, but not for schemas.
inline constexpr std::uint64_t kMostMessageBytes = ReadLimits{}.chunk_bytes - 1024;

struct ReadOptions {
  bool check_crcs = true;
  bool use_summary = true;  ///< `Reader` only; false: always scan the file.
  ReadLimits limits = {};
};

/// Why a reader stopped.
struct Stop {
  enum class Reason : std::uint8_t {
    kEnd,        ///< The file was read to its regular end.
    kTruncated,  ///< The end of the file is missing: its writer did not close it.
    kDamaged,    ///< Its content is wrong.
  };

  Reason reason = Reason::kEnd;
  Problem problem;  ///< Where, and why; unused for `kEnd`.
};

struct Frame;

/// Bytes of a source, with read-ahead.
///
/// @threads  Confined.
class Window {
 public:
  explicit Window(const Source& source) : source_(source), end_(source.size()) {}

  /// Borrowed until the next call.
  ///
  /// @pre  `offset + size <= end()`
  [[nodiscard]] Bytes view(std::uint64_t offset, std::size_t size);
  /// The size of the source at construction.
  [[nodiscard]] std::uint64_t end() const { return end_; }

 private:
  const Source& source_;
  const std::uint64_t end_;
  std::uint64_t begin_ = 0;
  std::vector<std::byte> bytes_;
};

/// Reads an MCAP file sequentially, record by record, also one without an end.
///
///     RecordReader reader(source);
///     while (const std::optional<Record> record = reader.next()) {
///       if (const auto* message = std::get_if<Message>(&*record)) { ... }
///     }
///     if (reader.stop()->reason != Stop::Reason::kEnd) { ... }
///
/// All records are returned in the order of the file; a chunk is followed by its contents. Of a
/// truncated last chunk, complete records are returned if it is not compressed, but not the chunk
/// itself. Records of unknown opcodes and schemas of id 0 are skipped.
///
/// Checks all CRCs (those of data section and summary at their end, after their records were
/// returned); that records are where they may be; that messages have channels and channels have
/// schemas; that repeated definitions are identical.
///
/// Memory: a record, an uncompressed chunk, and all schemas and channels; limited by `ReadLimits`.
///
/// @threads  Confined.
class RecordReader {
 public:
  /// `source` has to outlive this.
  explicit RecordReader(const Source& source, ReadOptions options = {});
  RecordReader(const RecordReader&) = delete;
  RecordReader& operator=(const RecordReader&) = delete;
  ~RecordReader() = default;

  /// The next record; its `Bytes` are valid until the next call. None at the end: see `stop()`.
  ///
  /// @errors  `Error` if the source cannot be read. `stop()` reports problems of its content.
  std::optional<Record> next();

  /// Position of the last record.
  [[nodiscard]] const Place& place() const { return place_; }
  /// Offset after the last record, or, in a chunk, after the chunk.
  [[nodiscard]] std::uint64_t next_offset() const { return position_; }
  /// Offset of the records of the last chunk, as stored in the file.
  [[nodiscard]] std::uint64_t offset_of_chunk_records() const { return chunk_records_offset_; }
  /// Whether the data section ended, with a correct CRC.
  [[nodiscard]] bool is_past_data() const { return is_past_data_; }

  /// Set when `next` returned none.
  [[nodiscard]] const std::optional<Stop>& stop() const { return stop_; }

  /// After damage: skips the damaged record, so that `next` continues after it; in a chunk, skips
  /// the rest of the chunk if the start of its next record is unknown. False if that is unknown in
  /// the file. CRCs of data section and summary are no longer checked.
  bool resume();

  /// The schemas and channels so far.
  [[nodiscard]] const Definitions& definitions() const { return definitions_; }

 private:
  enum class Section : std::uint8_t { kBegin, kHeader, kData, kSummary, kEnd };

  std::optional<Record> step();
  std::optional<Record> next_in_file();
  std::optional<Record> next_in_chunk();
  void read_magic();
  void read_end();
  bool enter_begun_chunk(std::uint64_t size);
  void leave_chunk();

  std::optional<Record> take(Opcode opcode, Bytes whole);
  void check_section(Opcode opcode) const;
  void check_length(const Frame& frame) const;
  bool keep(const Record& record, Bytes content);
  void define(const Record& record, std::size_t size);
  void check_data_end(const DataEnd& end);
  void check_footer(const Footer& footer, Bytes whole);
  void check_crc(Opcode opcode, std::uint32_t written, std::uint32_t computed) const;

  [[nodiscard]] bool has_end();
  void truncated(std::string record, std::string expected);
  [[noreturn]] void damaged(std::string record, std::string expected, std::string found) const;

  // Constant after construction.
  const ReadOptions options_;

  Window window_;
  Decompressor decompressor_;
  Definitions definitions_;
  std::uint64_t definition_bytes_ = 0;

  Section section_ = Section::kBegin;
  bool is_past_data_ = false;
  std::uint64_t position_ = 0;
  Place place_;
  std::optional<Stop> stop_;
  bool can_resume_ = false;

  Crc data_crc_;
  bool has_data_crc_ = true;  // Not after something was skipped.
  Crc summary_crc_;
  bool has_summary_crc_ = true;
  std::uint64_t summary_begin_ = 0;

  // The chunk that is being read, uncompressed.
  bool is_in_chunk_ = false;
  bool is_chunk_begun_only_ = false;
  Bytes chunk_;
  std::uint64_t chunk_position_ = 0;
  bool can_resume_in_chunk_ = false;
  std::uint64_t chunk_records_offset_ = 0;
  std::vector<std::byte> uncompressed_;
};

/// Whether `problem`, of a `RecordReader`, is that something follows the end of a whole file.
[[nodiscard]] bool is_behind_end(const Problem& problem);

/// Makes the records of `chunk` readable: returns `chunk.records` themselves, or fills `memory`.
///
/// @errors  `Damage` at `place`: unknown compression, a wrong CRC, sizes that contradict `limits`
///          or each other.
[[nodiscard]] Bytes uncompress(const Chunk& chunk, const ReadOptions& options, const Place& place,
                               Decompressor& decompressor, std::vector<std::byte>& memory);

}  // namespace fastcycle::mcap

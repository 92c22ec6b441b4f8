#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/files.h"
#include "diagnostics/crash_note.h"
#include "mcap/records.h"
#include "record/guarded_file.h"

namespace fastcycle::record {

/// One record read from a ring.
struct FlightRecord {
  std::uint16_t kind = 0;
  std::uint64_t number = 0;  ///< Index in the ring, from 0, without gaps.
  std::int64_t time_ns = 0;
  mcap::Bytes data;  ///< Borrowed from the reader.
};

/// A place between two records of a ring.
struct FlightMark {
  std::uint64_t position = 0;  ///< Bytes ever written before it.
  std::uint64_t number = 0;    ///< Of the next record.
};

/// A memory-mapped file of fixed size that keeps the last records even if the process crashes: the
/// newest record replaces the oldest.
///
///     FlightRing ring({.file = "drive.ring", .bytes = 64 << 20}, explanation);
///     ring.append(kind, time_ns, parts);
///     ring.close();
///
/// A record survives a kill of the process as soon as `append` has returned, since the kernel owns
/// the pages. The oldest record is released before its place is overwritten, and the new one is
/// counted after it was written, so that a kill between two instructions leaves only complete
/// records. Nothing is synced: a power failure may lose everything.
///
/// The constructor allocates the whole file and touches each of its pages: a full disk is an error
/// then, and no signal later. The file is locked as long as the ring lives, which distinguishes the
/// file of a live process from one left by a dead process. A forked child has neither the lock nor
/// the mapping.
///
/// If another program truncates the file, the ring continues in memory alone: `is_cut`.
///
/// @threads  `append`, `count_wake` and `close` by one thread; `oldest`, `newest` and `wakes` are
///           Safe.
/// @realtime No system call except in the constructor and at the end; pages that the kernel wrote
///           to disk meanwhile are made writable again, which may wait for the disk.
class FlightRing {
 public:
  struct Options {
    std::filesystem::path file;
    std::uint64_t bytes = std::uint64_t{256} << 20U;  ///< For records; rounded up to whole pages.
    std::int64_t start_ns = 0;                        ///< Of the run.
  };

  /// Larger records are refused, as are those above half of the ring.
  static constexpr std::uint64_t kRecordBytesMax = std::uint64_t{1} << 30U;

  /// Creates the file, replacing a ring without a writer. `explanation` is stored unchanged beside
  /// the records.
  ///
  /// @errors  `mcap::Error`: the name belongs to a file that is no ring, to a symbolic link, or to
  ///          a ring that another process writes; the disk is full; a folder is missing.
  FlightRing(const Options& options, mcap::Bytes explanation);
  FlightRing(const FlightRing&) = delete;
  FlightRing& operator=(const FlightRing&) = delete;
  ~FlightRing();

  /// Appends a record, the concatenation of `parts`. False if it is too large.
  bool append(std::uint16_t kind, std::int64_t time_ns,
              std::span<const mcap::Bytes> parts) noexcept;

  /// Counts another poll of the writer.
  void count_wake() noexcept;
  /// Marks the run as finished in order.
  void close() noexcept;

  /// Where a crash of the process leaves its note, for later readers of the file. Any thread.
  [[nodiscard]] diagnostics::CrashNote& crash_note() const noexcept;
  /// Whether appended data is in memory alone, because another program truncated the file.
  [[nodiscard]] bool is_cut() const noexcept { return mapped_->is_cut(); }
  /// Drops all records, once the file is cut. By the appending thread.
  void forget() noexcept;
  /// State of the file.
  [[nodiscard]] base::FileState look() const;

  /// The end of the last record. By the appending thread.
  [[nodiscard]] FlightMark mark() const noexcept { return {.position = head_, .number = number_}; }

  [[nodiscard]] std::uint64_t oldest() const noexcept;  ///< The position of the oldest record.
  [[nodiscard]] std::uint64_t newest() const noexcept;  ///< The position behind the newest.
  [[nodiscard]] std::uint64_t wakes() const noexcept;
  [[nodiscard]] std::uint64_t capacity() const noexcept { return capacity_; }
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }

 private:
  friend class FlightRingReader;

  struct Header;

  void make_file(const std::filesystem::path& file);
  void map(int descriptor, std::uint64_t size);
  void fill(const Options& options, mcap::Bytes explanation);
  void give_up(std::uint64_t until) noexcept;
  [[nodiscard]] std::uint64_t size_at(std::uint64_t position) const noexcept;
  void write_head(std::uint64_t position, std::uint16_t kind, std::int64_t time_ns,
                  std::uint64_t size, std::uint32_t data_crc) noexcept;

  // Constant after construction.
  const std::filesystem::path file_;
  const std::uint64_t capacity_;
  const std::uint64_t ring_offset_;  ///< Of the records, in the file.
  const std::int64_t start_ns_;
  const std::vector<std::byte> explanation_;
  std::optional<GuardedFile> mapped_;
  std::byte* memory_ = nullptr;
  std::byte* ring_ = nullptr;
  Header* header_ = nullptr;

  // Of the appending thread. Values in the file are never trusted.
  std::uint64_t tail_ = 0;
  std::uint64_t head_ = 0;
  std::uint64_t number_ = 0;
};

/// Reads a ring, from its oldest record to its newest: one that this process is writing, or a file
/// left by another process.
///
/// Of a ring that is being written, records overwritten before they were read are missing, and
/// counted. A damaged or hostile file yields an error or fewer records.
///
/// Memory: 1 MiB, or the largest record.
///
/// @threads  Confined; may run beside the appending thread.
class FlightRingReader {
 public:
  /// Opens a file left by a process. It is locked meanwhile.
  ///
  /// @errors  `mcap::Error`, a `Damage` if it is no ring or its header is wrong; also if a process
  ///          is writing it.
  explicit FlightRingReader(const std::filesystem::path& file);

  /// The present contents of `ring`, starting at `from`. Constructed by the appending thread, and
  /// then handed to any other; must not outlive the ring.
  FlightRingReader(const FlightRing& ring, const FlightMark& from);

  FlightRingReader(const FlightRingReader&) = delete;
  FlightRingReader& operator=(const FlightRingReader&) = delete;
  ~FlightRingReader();

  /// The next record; its data is valid until the next call. None if there is no further one.
  ///
  /// @errors  `mcap::Error` if the file cannot be read.
  std::optional<FlightRecord> next();

  /// The explanation stored by the writer.
  [[nodiscard]] mcap::Bytes explanation() const { return explanation_; }
  [[nodiscard]] bool is_closed() const { return is_closed_; }
  [[nodiscard]] std::int64_t start_ns() const { return start_ns_; }
  /// The process that wrote it.
  [[nodiscard]] std::uint32_t pid() const { return pid_; }
  /// The boot id of the machine at that time, as the kernel reports it.
  [[nodiscard]] const std::string& boot_id() const { return boot_id_; }
  [[nodiscard]] std::uint64_t wakes() const { return wakes_; }
  /// The note of a crash; none if there was none. Its texts are terminated, but must be escaped.
  [[nodiscard]] const std::optional<diagnostics::CrashNote>& crash_note() const { return note_; }

  /// Records overwritten before they were read, or damaged.
  [[nodiscard]] std::uint64_t missing() const { return missing_; }

 private:
  void read_header();
  void read_explanation(std::uint64_t size, std::uint32_t crc);
  void read(std::uint64_t offset, std::span<std::byte> into) const;
  [[nodiscard]] bool fetch(std::uint64_t size);
  [[nodiscard]] mcap::Bytes fetched(std::uint64_t size) const;
  [[noreturn]] void fail(std::uint64_t offset, std::string expected, std::string found) const;
  [[noreturn]] void damaged(std::uint64_t offset, std::string expected, std::string found) const;

  const std::filesystem::path file_;
  const FlightRing* const live_ = nullptr;
  const int descriptor_;
  std::uint64_t capacity_ = 0;
  std::uint64_t ring_offset_ = 0;
  std::vector<std::byte> explanation_;
  bool is_closed_ = false;
  std::int64_t start_ns_ = 0;
  std::uint32_t pid_ = 0;
  std::string boot_id_;
  std::uint64_t wakes_ = 0;
  std::optional<diagnostics::CrashNote> note_;

  std::uint64_t position_ = 0;
  std::uint64_t end_ = 0;
  std::optional<std::uint64_t> next_number_;
  std::optional<std::uint64_t> end_number_;  ///< Of the record at `end_`, if known.
  std::uint64_t missing_ = 0;
  std::uint64_t begin_ = 0;  ///< The position of `bytes_`.
  std::vector<std::byte> bytes_;
};

/// Whether `file` has the header of a ring; false also if it cannot be read.
[[nodiscard]] bool begins_as_ring(const std::filesystem::path& file);

}  // namespace fastcycle::record

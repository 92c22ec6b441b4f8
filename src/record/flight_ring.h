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

/// One record of a ring, as it is read.
struct FlightRecord {
  std::uint16_t kind = 0;
  std::uint64_t number = 0;  ///< Counts the records of a ring, from 0, without gaps.
  std::int64_t time_ns = 0;
  mcap::Bytes data;  ///< Borrowed from the reader.
};

/// A place between two records of a ring.
struct FlightMark {
  std::uint64_t position = 0;  ///< Bytes ever written before it.
  std::uint64_t number = 0;    ///< Of the next record.
};

/// A file of fixed size, mapped into memory, in which the last records are found whatever becomes
/// of the process: the newest one takes the place of the oldest.
///
///     FlightRing ring({.file = "drive.ring", .bytes = 64 << 20}, explanation);
///     ring.append(kind, time_ns, parts);
///     ring.close();
///
/// A record is there once `append` has returned, also if the process is killed right after: what
/// was stored is the kernel's. The oldest record is given up before its place is written to, and
/// the new one is counted after it was written, so that a kill between two instructions leaves
/// whole records only. Nothing is synced: a power cut may take everything.
///
/// The file is allocated as a whole, and each of its pages touched, when the ring is made: a full
/// disk is an error then, and no signal later. It is locked as long as the ring lives, which tells
/// the file of a process that lives from one that a dead process left. A child that the process
/// forks has neither the lock nor the mapping.
///
/// Where another program cuts the file off, the ring goes on in memory alone: `is_cut`.
///
/// @threads  `append`, `count_wake` and `close` by one thread; `oldest`, `newest` and `wakes` are
///           Safe.
/// @realtime No system call but in the constructor and at the end; pages that the kernel wrote to
///           the disk meanwhile are made writable again, which may wait for the disk.
class FlightRing {
 public:
  struct Options {
    std::filesystem::path file;
    std::uint64_t bytes = std::uint64_t{256} << 20U;  ///< For records; rounded up to whole pages.
    std::int64_t start_ns = 0;                        ///< Of the run.
  };

  /// Larger records are refused, as are those above half of the ring.
  static constexpr std::uint64_t kRecordBytesMax = std::uint64_t{1} << 30U;

  /// Makes the file, in the place of a ring that nobody writes. `explanation` is kept beside the
  /// records as it is.
  ///
  /// @errors  `mcap::Error`: the place is taken by something that is no ring, by a symbolic link,
  ///          or by a ring that another process writes; there is no room; a folder is missing.
  FlightRing(const Options& options, mcap::Bytes explanation);
  FlightRing(const FlightRing&) = delete;
  FlightRing& operator=(const FlightRing&) = delete;
  ~FlightRing();

  /// Adds a record: all of `parts`, one after the other. False if it is too large.
  bool append(std::uint16_t kind, std::int64_t time_ns,
              std::span<const mcap::Bytes> parts) noexcept;

  /// Says that the writer has looked for something to write once more.
  void count_wake() noexcept;
  /// Says that the run ended in order.
  void close() noexcept;

  /// Where a crash of the process leaves what it knows, for who reads the file later. Any thread.
  [[nodiscard]] diagnostics::CrashNote& crash_note() const noexcept;
  /// Whether what is appended stands in memory alone, since another program cut the file off.
  [[nodiscard]] bool is_cut() const noexcept { return mapped_->is_cut(); }
  /// Forgets what there is, once it is cut off. By the thread that appends.
  void forget() noexcept;
  /// What became of the file.
  [[nodiscard]] base::FileState look() const;

  /// Behind the last record. By the thread that appends.
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

  // The thread that appends. What stands in the file is never believed.
  std::uint64_t tail_ = 0;
  std::uint64_t head_ = 0;
  std::uint64_t number_ = 0;
};

/// Reads a ring, from its oldest record to its newest: one that is being written, by its own
/// process, or the file that a process left.
///
/// Of a ring that is being written, what was overwritten before it was read is missing, and
/// counted. A damaged or hostile file gives an error or fewer records.
///
/// Memory: 1 MiB, or the largest record.
///
/// @threads  Confined; beside the thread that appends.
class FlightRingReader {
 public:
  /// The file that a process left. It is locked meanwhile.
  ///
  /// @errors  `mcap::Error`, a `Damage` where it is no ring or its header is wrong; also if a
  ///          process writes it.
  explicit FlightRingReader(const std::filesystem::path& file);

  /// What stands in `ring` now, from `from` on. Made by the thread that appends, and then given
  /// to any other; the ring has to live as long.
  FlightRingReader(const FlightRing& ring, const FlightMark& from);

  FlightRingReader(const FlightRingReader&) = delete;
  FlightRingReader& operator=(const FlightRingReader&) = delete;
  ~FlightRingReader();

  /// The next record; its data is valid until the next call. None if there is no further one.
  ///
  /// @errors  `mcap::Error` if the file cannot be read.
  std::optional<FlightRecord> next();

  /// What the writer kept beside the records.
  [[nodiscard]] mcap::Bytes explanation() const { return explanation_; }
  [[nodiscard]] bool is_closed() const { return is_closed_; }
  [[nodiscard]] std::int64_t start_ns() const { return start_ns_; }
  /// The process that wrote it.
  [[nodiscard]] std::uint32_t pid() const { return pid_; }
  /// The boot of the machine in which it did, as the kernel calls it.
  [[nodiscard]] const std::string& boot_id() const { return boot_id_; }
  [[nodiscard]] std::uint64_t wakes() const { return wakes_; }
  /// What a crash left; none if there was none. Its texts end, and are to be shown with care.
  [[nodiscard]] const std::optional<diagnostics::CrashNote>& crash_note() const { return note_; }

  /// Records that are not there: overwritten before they were read, or damaged.
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
  std::optional<std::uint64_t> end_number_;  ///< Of the record at `end_`, where it is known.
  std::uint64_t missing_ = 0;
  std::uint64_t begin_ = 0;  ///< The position of `bytes_`.
  std::vector<std::byte> bytes_;
};

/// Whether `file` begins as a ring does; false also if it cannot be read.
[[nodiscard]] bool begins_as_ring(const std::filesystem::path& file);

}  // namespace fastcycle::record

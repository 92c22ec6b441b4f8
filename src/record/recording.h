#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mcap/chunk_builder.h"
#include "mcap/file.h"
#include "mcap/writer.h"
#include "record/syncer.h"

namespace fastcycle::record {

/// When one file of a recording ends and the next one begins. 0: never.
struct Splitting {
  std::uint64_t bytes = 0;
  std::chrono::nanoseconds time{0};  ///< From the first message of a file, by log time.

  [[nodiscard]] bool is_on() const { return bytes > 0 || time.count() > 0; }
};

/// The files of one recording, one after the other.
///
/// While a file is written its name ends in `.active`; it is synced and renamed when it is whole.
/// So a name that ends in `.mcap` is a file that was closed. A recording that is split has a number
/// before the suffix: `drive_0001.mcap`. The next file is open before the one before is closed.
///
/// Getting files onto the disk is left to a `Syncer`: nothing here waits for that but `close`.
///
/// What cannot be written, since the disk is full or gone, is for the caller to count; a new file
/// is then tried at most every second, and the one that failed stays as it is, with all that could
/// be written; one that could not be begun is removed.
///
/// @threads  Confined.
class Recording {
 public:
  struct Options {
    std::filesystem::path file;
    Splitting splitting = {};
    std::chrono::nanoseconds sync_interval{std::chrono::seconds(1)};  ///< 0: only at the end.
  };

  /// What stands at the beginning of each file.
  using Preamble = std::function<void(mcap::Writer&)>;
  /// What is added before a file is closed.
  using Closing = std::function<void(mcap::Writer&)>;

  Recording(Options options, Preamble preamble, Closing closing);
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;
  ~Recording();

  /// Opens the first file. A name that is taken is left alone, and the next number is tried. False
  /// if no file can be made; it is tried again when something is written.
  bool open();

  /// Appends a closed chunk. False if it could not be written.
  bool write(mcap::ChunkBuilder& chunk);

  /// Writes the end of the last file, and waits until all are on the disk. False if it could not be
  /// written.
  bool close();

  /// What went wrong last; empty if nothing did since the last file was opened.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  /// All files so far, in order, with the names that they have now.
  [[nodiscard]] const std::vector<std::filesystem::path>& files() const { return files_; }
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  struct File {
    std::filesystem::path active;
    std::filesystem::path whole;
    std::shared_ptr<mcap::FileSink> sink;
    std::unique_ptr<mcap::Writer> writer;
    std::optional<std::uint64_t> first_ns;
  };

  [[nodiscard]] std::filesystem::path name_of(unsigned number) const;
  /// A new file under the next name that is free; moves `number_` there.
  [[nodiscard]] File make();
  [[nodiscard]] bool is_full(const mcap::ChunkBuilder& next) const;
  bool finish(File& file);
  void give_up();
  bool start_next();
  void sync_if_due();
  void take(const std::vector<Syncer::Outcome>& outcomes);

  const Options options_;
  const Preamble preamble_;
  const Closing closing_;
  unsigned number_ = 0;
  File file_;
  std::vector<std::filesystem::path> files_;
  std::uint64_t bytes_before_ = 0;  ///< In the files before this one.
  std::string problem_;
  std::chrono::steady_clock::time_point synced_;
  std::chrono::steady_clock::time_point tried_;
  std::optional<Syncer> syncer_;  // From `open` on.
};

}  // namespace fastcycle::record

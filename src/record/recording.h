#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mcap/chunk_builder.h"
#include "mcap/file.h"
#include "mcap/writer.h"
#include "record/syncer.h"

namespace fastcycle::record {

/// When a recording continues in a new file. 0: never.
struct Splitting {
  std::uint64_t bytes = 0;
  std::chrono::nanoseconds time{0};  ///< From the first message of a file, by log time.

  [[nodiscard]] bool is_on() const { return bytes > 0 || time.count() > 0; }
};

/// The files of one recording, written in sequence.
///
/// While a file is written its name ends in `.active`; it is synced and renamed when it is
/// complete. So a name that ends in `.mcap` is a closed file. A split recording has a number before
/// the suffix: `drive_0001.mcap`. The next file is opened before the previous one is closed.
///
/// A `Syncer` syncs the files: only `close` waits for that. It also checks that they still exist.
/// What others deleted or truncated is lost, and a new file is started; a file that was moved is
/// written to its end where it is.
///
/// If the disk is full or gone, the caller counts what cannot be written; a new file is then tried
/// at most every second. The failed one stays with all that could be written; one that could not be
/// started is removed.
///
/// @threads  Confined.
class Recording {
 public:
  struct Options {
    std::filesystem::path file;
    Splitting splitting = {};
    std::chrono::nanoseconds sync_interval{std::chrono::seconds(1)};  ///< 0: only at the end.
  };

  /// A change of a file's state.
  struct News {
    std::filesystem::path active;  ///< Its name while it was written.
    std::string text = {};         ///< Message for the user; empty: the file is as requested.
    bool is_lost = false;          ///< Its contents are lost.
    bool is_over = true;           ///< No further change will follow.
    bool is_trouble = true;        ///< `text` reports an error.
  };

  /// Writes the beginning of each file.
  using Preamble = std::function<void(mcap::Writer&)>;
  /// Called before a file is closed.
  using Closing = std::function<void(mcap::Writer&)>;

  Recording(Options options, Preamble preamble, Closing closing);
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;
  ~Recording();

  /// Opens the first file. If the name is taken the next number is tried, also if several
  /// recordings start at the same time. False if no file can be created; `write` then tries again.
  bool open();

  /// Appends a closed chunk. False if it could not be written.
  bool write(mcap::ChunkBuilder& chunk);

  /// Finishes the last file, and waits until all are on disk. False on a write error.
  bool close();

  /// The file written last, by its name while being written.
  [[nodiscard]] const std::filesystem::path& active() const { return file_.active; }
  /// Changes of files since the last call.
  [[nodiscard]] std::vector<News> take_news() { return std::exchange(news_, {}); }

  /// The last error; empty if there was none since the last file was opened.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  /// All files so far, in order, with their present names.
  [[nodiscard]] const std::vector<std::filesystem::path>& files() const { return files_; }
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  struct File {
    std::filesystem::path active;
    std::filesystem::path whole;
    std::shared_ptr<mcap::FileSink> sink;
    std::unique_ptr<mcap::Writer> writer;
    std::optional<std::uint64_t> first_ns;
    std::string reported;  ///< The last problem reported.
  };

  [[nodiscard]] std::filesystem::path name_of(unsigned number) const;
  /// A new file with the next free name; moves `number_` there.
  [[nodiscard]] File make();
  [[nodiscard]] static std::unique_ptr<mcap::FileSink> make_sink(const File& file);
  [[nodiscard]] bool is_full(const mcap::ChunkBuilder& next) const;
  bool finish(File& file);
  void give_up();
  bool start_next();
  void sync_if_due();
  void take(const std::vector<Syncer::Outcome>& outcomes);
  void take_problem(const Syncer::Outcome& outcome);

  const Options options_;
  const Preamble preamble_;
  const Closing closing_;
  unsigned number_ = 0;
  File file_;
  std::vector<std::filesystem::path> files_;
  std::uint64_t bytes_before_ = 0;  ///< In the files before this one.
  std::string problem_;
  std::vector<News> news_;
  std::filesystem::path lost_;  ///< The last file found lost.
  std::chrono::steady_clock::time_point synced_;
  std::chrono::steady_clock::time_point tried_;
  std::optional<Syncer> syncer_;  // From `open` on.
};

}  // namespace fastcycle::record

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
/// Getting files onto the disk is left to a `Syncer`: nothing here waits for that but `close`. It
/// also looks whether they are still there. What others deleted or cut off is lost, and a new file
/// is begun; one that was moved is written to its end where it is.
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

  /// What became of a file.
  struct News {
    std::filesystem::path active;  ///< The name that it had while it was written.
    std::string text = {};         ///< What is to be said; empty: it is as it was asked for.
    bool is_lost = false;          ///< What was written into it is gone.
    bool is_over = true;           ///< Nothing more will come of it.
    bool is_trouble = true;        ///< Of what is to be said.
  };

  /// What stands at the beginning of each file.
  using Preamble = std::function<void(mcap::Writer&)>;
  /// What is added before a file is closed.
  using Closing = std::function<void(mcap::Writer&)>;

  Recording(Options options, Preamble preamble, Closing closing);
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;
  ~Recording();

  /// Opens the first file. A name that is taken is left alone, and the next number is tried, also
  /// where several begin at the same time. False if no file can be made; it is tried again when
  /// something is written.
  bool open();

  /// Appends a closed chunk. False if it could not be written.
  bool write(mcap::ChunkBuilder& chunk);

  /// Writes the end of the last file, and waits until all are on the disk. False if it could not be
  /// written.
  bool close();

  /// The file that has what was written last, by the name that it has meanwhile.
  [[nodiscard]] const std::filesystem::path& active() const { return file_.active; }
  /// What became of files since the last call.
  [[nodiscard]] std::vector<News> take_news() { return std::exchange(news_, {}); }

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
    std::string told;  ///< Of what is the matter with it.
  };

  [[nodiscard]] std::filesystem::path name_of(unsigned number) const;
  /// A new file under the next name that is free; moves `number_` there.
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
  std::filesystem::path lost_;  ///< The last file that was found to be.
  std::chrono::steady_clock::time_point synced_;
  std::chrono::steady_clock::time_point tried_;
  std::optional<Syncer> syncer_;  // From `open` on.
};

}  // namespace fastcycle::record

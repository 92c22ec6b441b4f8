#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/files.h"
#include "base/thread.h"
#include "mcap/file.h"

namespace fastcycle::record {

/// Syncs files to disk on a thread of its own. A sync may take a second where a write took a
/// moment; the writer must not wait for it, since data that arrives meanwhile is lost if the
/// process dies.
///
/// Memory: a few words for each pending file, of which there are at most `kMostFiles`.
///
/// @threads  Confined.
class Syncer {
 public:
  /// A file, and its final name once it is on disk; no name while it is still being written.
  struct File {
    std::shared_ptr<mcap::FileSink> sink;
    std::filesystem::path active;
    std::filesystem::path whole = {};
  };

  /// Result for one file.
  struct Outcome {
    std::filesystem::path active;
    std::filesystem::path asked;  ///< The requested final name.
    std::filesystem::path whole;  ///< The final name; empty: none.
    std::string problem;          ///< Empty: it is on disk, in its place.
    /// State of the file as readers find it. `kThere` also if the sync failed.
    base::FileState::Kind state = base::FileState::Kind::kThere;
  };

  static constexpr std::size_t kMostFiles = 4;

  Syncer();
  Syncer(const Syncer&) = delete;
  Syncer& operator=(const Syncer&) = delete;
  /// Waits for pending files.
  ~Syncer();

  /// Syncs a file soon, checks that it still exists, and renames it if it has a final name; a taken
  /// name gets a number, as `drive_0002.mcap`. Does nothing for a file that is still being written
  /// and already pending; waits only while `kMostFiles` are pending.
  void sync(File file);

  /// Results since the last call.
  [[nodiscard]] std::vector<Outcome> outcomes();
  /// The same, once nothing is pending.
  [[nodiscard]] std::vector<Outcome> wait();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable came_;
  std::condition_variable went_;
  std::deque<File> files_;  ///< The first one is being synced.
  std::vector<Outcome> outcomes_;
  bool stops_ = false;

  std::vector<base::Refusal> refusals_;
  base::Thread thread_;
};

}  // namespace fastcycle::record

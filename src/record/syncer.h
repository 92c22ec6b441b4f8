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

/// Gets files onto the disk, on a thread of its own. A disk may take a second for what a write took
/// a moment for; whoever writes must not wait for it, since what comes meanwhile is lost if the
/// process dies.
///
/// Memory: a few words for each file that is on its way, and there are at most `kMostFiles`.
///
/// @threads  Confined.
class Syncer {
 public:
  /// A file, and the name that it gets once it is on the disk; none if it is still being written.
  struct File {
    std::shared_ptr<mcap::FileSink> sink;
    std::filesystem::path active;
    std::filesystem::path whole = {};
  };

  /// What became of one.
  struct Outcome {
    std::filesystem::path active;
    std::filesystem::path asked;  ///< The name that it was to get.
    std::filesystem::path whole;  ///< The name that it got; empty: none.
    std::string problem;          ///< Empty: it is on the disk, where it belongs.
    /// What readers find of what was written. It is `kThere` also where it was not synced.
    base::FileState::Kind state = base::FileState::Kind::kThere;
  };

  static constexpr std::size_t kMostFiles = 4;

  Syncer();
  Syncer(const Syncer&) = delete;
  Syncer& operator=(const Syncer&) = delete;
  /// Waits for what is on its way.
  ~Syncer();

  /// Syncs a file soon, looks whether it is still there, and renames it if it gets another name. A
  /// name that something else has meanwhile is left alone: it gets a number then, as
  /// `drive_0002.mcap`. Does nothing for one that is being written and is on its way already; waits
  /// only while `kMostFiles` are.
  void sync(File file);

  /// What became of files since the last call.
  [[nodiscard]] std::vector<Outcome> outcomes();
  /// The same, once nothing is on its way any more.
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

#pragma once

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "archive/progress.h"
#include "mcap/error.h"
#include "replay/exact_replay.h"
#include "stop_signals.h"

namespace fastcycle::tool {

/// Thrown on the first Ctrl-C.
class Interrupted final : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("stopped on request, and what was begun is removed") {}
};

/// Work on large files: shows its progress in a line of standard error if that is a terminal, and
/// ends in order on the first Ctrl-C: incomplete files are removed.
///
/// @threads  Confined to its owner.
class FileWork {
 public:
  explicit FileWork(bool shows_progress);
  FileWork(const FileWork&) = delete;
  FileWork& operator=(const FileWork&) = delete;
  ~FileWork();

  /// The progress callback for a reader of `total` bytes; valid as long as this. Throws
  /// `Interrupted`.
  [[nodiscard]] archive::Progress progress(std::string what, std::uint64_t total);

  /// The same for `ExactReplay`, which counts `unit` and ends early on Ctrl-C.
  [[nodiscard]] host::ExactReplay::Watcher steps(std::string what, std::string unit);

 private:
  void show(const std::string& what, std::uint64_t done, std::uint64_t total);

  const bool is_shown_;
  bool is_line_shown_ = false;
  std::chrono::steady_clock::time_point drawn_ = std::chrono::steady_clock::now();
  std::atomic<bool> is_stopped_{false};
  const sigset_t signals_;
  const StopSignals stop_signals_;
};

/// Standard output to a reader that may close it early: `| head`.
///
/// @threads  Confined.
class Output {
 public:
  Output();

  /// Writes `text` with unprintable bytes shown as `\x1b`. False if the reader has closed the pipe.
  ///
  /// @errors  `std::runtime_error` if writing fails for another reason.
  bool write(std::string_view text);
  /// The same with all bytes unchanged, for another program.
  bool write_data(std::string_view data);
  bool flush();

 private:
  static bool has_taken(bool is_written);
};

/// Prints `fastcycle convert: …` to standard error; returns the exit code of a wrong command line.
int print_error(const std::string& command, const std::string& sentence);

/// Prints what is wrong with a file that is usable nevertheless.
void print_problem(const std::string& command, const mcap::Problem& problem,
                   const std::string& consequence);

}  // namespace fastcycle::tool

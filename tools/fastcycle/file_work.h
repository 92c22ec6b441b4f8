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

/// The first Ctrl-C came.
class Interrupted final : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("stopped on request, and what was begun is removed") {}
};

/// Work on large files: shows how far it is, in a line of standard error where that is a terminal,
/// and ends in order on the first Ctrl-C: files that are not whole are removed.
///
/// @threads  Confined to its owner.
class FileWork {
 public:
  explicit FileWork(bool shows_progress);
  FileWork(const FileWork&) = delete;
  FileWork& operator=(const FileWork&) = delete;
  ~FileWork();

  /// What a reader of `total` bytes is to tell; valid as long as this. It throws `Interrupted`.
  [[nodiscard]] archive::Progress progress(std::string what, std::uint64_t total);

  /// The same of `ExactReplay`, which counts `unit` and is told to end early.
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

/// Standard output, read by somebody who may have seen enough: `| head`.
///
/// @threads  Confined.
class Output {
 public:
  Output();

  /// Writes `text` with what is not printable in it shown as `\x1b`. False if nobody reads any
  /// more.
  ///
  /// @errors  `std::runtime_error` if it cannot be written for another reason.
  bool write(std::string_view text);
  /// The same with all bytes as they are, for another program.
  bool write_data(std::string_view data);
  bool flush();

 private:
  static bool has_taken(bool is_written);
};

/// `fastcycle convert: …`, on standard error; the exit code of a wrong command line.
int print_mistake(const std::string& command, const std::string& sentence);

/// Says what is wrong with a file that could be used nevertheless.
void print_problem(const std::string& command, const mcap::Problem& problem,
                   const std::string& consequence);

}  // namespace fastcycle::tool

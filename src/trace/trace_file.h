#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/output_file.h"
#include "base/thread.h"

namespace fastcycle::trace {

/// A file that a thread of the lowest priority writes, with a bounded buffer. Only its owner can
/// read it.
///
/// @threads  `append` by one thread; all else by the control thread.
class TraceFile {
 public:
  /// `inputs` are never replaced.
  TraceFile(std::filesystem::path file, std::uint64_t buffer_bytes,
            std::vector<std::filesystem::path> inputs = {});
  TraceFile(const TraceFile&) = delete;
  TraceFile& operator=(const TraceFile&) = delete;
  ~TraceFile();

  /// Creates the file, replacing one of its name.
  ///
  /// @errors  `std::runtime_error`: see `base::OutputFile`.
  void open();
  void start(std::vector<base::Refusal>& refusals);

  /// Takes all of `bytes`, or none: false if the buffer is full, or the file cannot be written.
  /// With `waits` it waits for room.
  bool append(std::string_view bytes, bool waits);

  /// Writes the buffer, and closes the file. A regular file that could not be written is removed.
  void close();

  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }
  /// Size of the file in bytes; 0 if it was removed. When closed.
  [[nodiscard]] std::uint64_t written() const noexcept { return written_; }
  /// An error; empty if there was none. When closed.
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

 private:
  static constexpr std::size_t kChunk = 64UL * 1024;

  void write_chunks();
  bool write(std::string_view bytes);
  [[nodiscard]] bool has_own_name() const;

  const std::filesystem::path file_;
  const std::uint64_t buffer_bytes_;
  const std::vector<std::filesystem::path> inputs_;
  std::optional<base::OutputFile> output_;
  base::Thread writing_;
  bool is_started_ = false;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::condition_variable has_room_;
  std::deque<std::string> chunks_;  ///< The last one is being filled.
  std::uint64_t waiting_ = 0;       ///< Bytes in `chunks_`, and those being written.
  bool is_closing_ = false;

  std::uint64_t written_ = 0;  ///< Of the writing thread, until it has ended.
  std::string problem_;        ///< Under the mutex, until it has ended.
};

}  // namespace fastcycle::trace

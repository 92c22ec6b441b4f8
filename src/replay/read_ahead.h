#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "record/recording_reader.h"

namespace fastcycle::host {

/// Reads a recording on a thread of its own, and owns that thread and the messages read ahead. So
/// the consumer of timed messages need not wait for the disk.
///
/// Memory: `kBytes` of messages, or one that is larger.
///
/// @threads  Confined.
class ReadAhead {
 public:
  static constexpr std::size_t kBytes = std::size_t{64} << 20U;

  /// From now on only this uses `reader`.
  explicit ReadAhead(record::RecordingReader& reader);
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;
  ~ReadAhead();

  /// Waits for the next message; none at the end.
  ///
  /// @errors  As `RecordingReader::next`.
  std::optional<record::RecordedMessage> next();

 private:
  void read();
  /// Waits for room; false if this is being destroyed.
  bool put(record::RecordedMessage message);

  record::RecordingReader& reader_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<record::RecordedMessage> messages_;
  std::size_t bytes_ = 0;
  bool is_over_ = false;
  bool is_stopped_ = false;
  std::exception_ptr error_;
  std::thread thread_;
};

}  // namespace fastcycle::host

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

/// Reads a recording on a thread of its own: owns that, and what was read ahead. So the disk is
/// not in the way of who needs the next message at a certain time.
///
/// Memory: `kBytes` of messages, or one that is larger.
///
/// @threads  Confined.
class ReadAhead {
 public:
  static constexpr std::size_t kBytes = std::size_t{64} << 20U;

  /// From now on `reader` is used by this alone.
  explicit ReadAhead(record::RecordingReader& reader);
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;
  ~ReadAhead();

  /// The next message, once it was read; none if there is no further one.
  ///
  /// @errors  As `RecordingReader::next`.
  std::optional<record::RecordedMessage> next();

 private:
  void read();
  /// Waits for room; false if nobody wants more.
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

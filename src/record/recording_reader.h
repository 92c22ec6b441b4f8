#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fastcycle/message.h"
#include "mcap/file.h"
#include "mcap/reader.h"

namespace fastcycle::record {

/// Messages of one component on one topic, over all files of a recording.
struct RecordedStream {
  std::string topic;
  std::string publisher;         ///< The component; empty: unknown.
  PublisherId publisher_id = 0;  ///< Distinguishes several of one component; 0: unknown.
  std::string encoding;          ///< Of the messages: `protobuf`.
  std::string type;              ///< The messages' full name; empty: there is no schema.
  std::string schema;            ///< A serialized `FileDescriptorSet`, if the encoding is protobuf.
  std::uint64_t messages = 0;
};

/// A message of a recording.
struct RecordedMessage {
  std::size_t stream = 0;  ///< Index in `RecordingReader::streams`.
  /// As it was published. `publisher` is not set; `origin.root` 0 means the message's own
  /// publisher.
  MessageInfo info;
  /// When subscribers received it, or, if it was published before the file began, when that began.
  Time due{};
  std::uint32_t step = 0;  ///< In simulated time: the round in that moment.
  std::vector<std::byte> data;
};

/// Reads the files of a `Recorder`, or any MCAP file, in the original order: by time, then by
/// round, then by publisher and sequence.
///
///     RecordingReader reader({"drive_0001.mcap", "drive_0002.mcap.active"});
///     reader.rewind({.wanted = {true, false}, .from = reader.begin(), .to = reader.end()});
///     for (auto moment = reader.next(); !moment.empty(); moment = reader.next()) { ... }
///
/// A file that was not closed is read up to its last complete message. Messages that a later file
/// of a split recording repeats are returned once. Files of other software have fewer facts: then
/// each message is its own measurement, ordered by log time.
///
/// Memory: the messages of one moment, and that of `mcap::MessageReader` for each file.
///
/// @threads  Confined.
class RecordingReader {
 public:
  /// @errors  `mcap::Error` if a file cannot be read, or is not valid.
  explicit RecordingReader(const std::vector<std::filesystem::path>& files);
  RecordingReader(const RecordingReader&) = delete;
  RecordingReader& operator=(const RecordingReader&) = delete;
  ~RecordingReader();

  [[nodiscard]] const std::vector<RecordedStream>& streams() const { return streams_; }
  /// When the recorded run began; if unknown, when the first message was published.
  [[nodiscard]] Time begin() const { return begin_; }
  /// When the timers of that run started; if unknown, when the run began.
  [[nodiscard]] Time begin_of_timers() const { return std::max(begin_, begin_of_timers_); }
  /// When it ended; if unknown, when the last message was published.
  [[nodiscard]] Time end() const { return end_; }
  /// Facts recorded at the end of the run, by name; empty for a file that was not closed.
  [[nodiscard]] const std::map<std::string, std::string>& end_facts() const { return end_facts_; }
  /// Remarks on the files, such as one that was not closed.
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }

  struct Selection {
    std::vector<bool> wanted;  ///< By stream.
    Time from{};
    Time to{};  ///< Inclusive.
  };
  /// Selects what `next` returns, and starts at its beginning.
  void rewind(Selection selection);

  /// All messages that are due next at the same time; none at the end. Valid, and the caller may
  /// change them, until the next call.
  ///
  /// @errors  `mcap::Error` with the place that cannot be read. The reader is unusable afterwards.
  std::span<RecordedMessage> next();

  /// Number of messages whose facts a tool has moved too far behind them in the file: their
  /// sequence, origin and round have the default values.
  [[nodiscard]] std::uint64_t parted_infos() const { return parted_infos_; }

 private:
  struct File;

  void open(const std::filesystem::path& path);
  void add_streams(File& file);
  void read_facts(const File& file);
  void advance(File& file);
  void take_infos(File& file, const mcap::StoredMessage& message);
  void drop_parted_infos(File& file);
  [[nodiscard]] File* earliest() const;
  void take(File& file);

  std::vector<std::unique_ptr<File>> files_;
  std::vector<RecordedStream> streams_;
  std::vector<std::string> notes_;
  std::map<std::string, std::string> end_facts_;
  Time begin_{};
  Time begin_of_timers_{};
  Time end_{};
  bool has_begin_ = false;

  Selection selection_;
  // By stream: of what was returned since `rewind`, before this moment.
  std::vector<std::uint64_t> first_sequences_;
  std::vector<std::uint64_t> last_sequences_;
  std::vector<RecordedMessage> moment_;  ///< Reused memory; `count_` are in use.
  std::size_t count_ = 0;
  std::uint64_t parted_infos_ = 0;
};

}  // namespace fastcycle::record

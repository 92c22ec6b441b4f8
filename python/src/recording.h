#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "mcap/file.h"
#include "mcap/reader.h"

namespace fastcycle::python {

/// The files of one recording, opened together, and read as if they were one.
///
///     const auto recording = std::make_shared<Recording>(paths);
///     Cursor cursor(recording, {.topics = {"control/speed"}});
///     while (const mcap::StoredMessage* message = cursor.next()) { ... }
///
/// @threads  Compatible.
class Recording {
 public:
  struct File {
    explicit File(const std::filesystem::path& path) : source(path), reader(source) {}

    mcap::FileSource source;
    mcap::Reader reader;
  };

  /// @errors  `mcap::Error` if a file cannot be read, is damaged, or ends before its first message.
  explicit Recording(const std::vector<std::filesystem::path>& paths);

  /// In the order of the times at which they begin.
  [[nodiscard]] const std::vector<std::unique_ptr<File>>& files() const { return files_; }
  /// What errors call the recording.
  [[nodiscard]] const std::string& name() const { return name_; }
  /// All topics, in the order of the alphabet.
  [[nodiscard]] std::vector<std::string> topics() const;
  /// @errors  `NotFound` that names the topics that there are.
  void require_topic(const std::string& topic) const;
  /// The schema of a topic, whose messages are protobuf of one type.
  ///
  /// @errors  `NotFound`; `mcap::Error` if the messages are something else.
  [[nodiscard]] const mcap::Schema& schema_of(const std::string& topic) const;

 private:
  std::vector<std::unique_ptr<File>> files_;
  std::string name_;
};

/// Messages of a recording in the order of their log times. A latched message that stands once more
/// at the beginning of a later file comes once.
///
/// @threads  Confined.
class Cursor {
 public:
  Cursor(std::shared_ptr<const Recording> recording, mcap::MessageQuery query);

  /// The next message, valid until the next call. Null if there is no further one.
  ///
  /// @errors  `mcap::Error`; the cursor is of no use afterwards.
  const mcap::StoredMessage* next();

 private:
  struct Stream {
    mcap::MessageReader messages;
    std::optional<mcap::StoredMessage> head = {};
  };
  /// A topic, the component that publishes on it, and which of its publishers.
  using Publisher = std::tuple<std::string, std::string, std::string>;

  [[nodiscard]] Stream* earliest();
  void open_next_file();
  bool is_repeated(const mcap::StoredMessage& message);

  const std::shared_ptr<const Recording> recording_;
  const mcap::MessageQuery query_;
  std::vector<std::unique_ptr<Stream>> open_;
  std::size_t opened_ = 0;  ///< Files so far.
  Stream* current_ = nullptr;
  std::map<const mcap::Channel*, std::uint32_t*> last_of_channel_;
  std::map<Publisher, std::uint32_t> last_sequences_;
};

}  // namespace fastcycle::python

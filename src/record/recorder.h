#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/thread.h"
#include "broker/topics.h"
#include "executor/activation_ring.h"
#include "mcap/compression.h"
#include "mcap/record_reader.h"
#include "mcap/topic_filter.h"
#include "record/recording.h"
#include "record/serializer.h"
#include "record/stored_message.h"
#include "record/streams.h"

namespace fastcycle::record {

class Batch;

/// Compression of the messages of some topics.
struct CompressionRule {
  std::string pattern;  ///< See `mcap::matches`.
  mcap::ChunkOptions chunk = {};
};

/// What is recorded, and to which files.
struct RecorderOptions {
  Recording::Options recording = {};
  mcap::TopicFilter filter = {};
  mcap::ChunkOptions chunk = {.compression = mcap::Compression::kLz4};  ///< If no rule matches.
  std::vector<CompressionRule> rules = {};                    ///< The first match applies.
  std::uint64_t memory_bytes = std::uint64_t{256} << 20U;     ///< Limit of unwritten data.
  std::uint64_t message_bytes_max = mcap::kMostMessageBytes;  ///< Larger messages are lost.
  bool records_activations = true;
  /// Its threads run only on idle CPUs.
  bool is_background = false;
};

/// Statistics of one topic.
struct RecordedTopic {
  std::string topic;
  std::uint64_t published = 0;
  std::uint64_t recorded = 0;
  std::uint64_t bytes = 0;      ///< Of the recorded messages, serialized.
  std::uint64_t overflow = 0;   ///< Lost: overwritten in the queue before the recorder took them.
  std::uint64_t pool = 0;       ///< Lost: the publisher's pool was exhausted; not published at all.
  std::uint64_t memory = 0;     ///< Lost: `memory_bytes` was exhausted.
  std::uint64_t disk = 0;       ///< Lost: not written, or their file was removed.
  std::uint64_t too_large = 0;  ///< Lost: above `message_bytes_max`.
  std::uint64_t process = 0;    ///< Lost: on the way from the publishing process.
  std::uint64_t shutdown = 0;   ///< Lost: published before the start or after the stop.

  [[nodiscard]] std::uint64_t lost() const {
    return overflow + pool + memory + disk + too_large + process + shutdown;
  }
};

/// Records messages and activations of a running application into MCAP files.
///
/// One thread takes the messages out of a tap every few milliseconds and puts them into chunks:
/// small ones copied, large ones by reference. Another one compresses and writes. So a publisher
/// pays only for one more queue; what the disk cannot take at once waits, up to the memory limit,
/// beyond which messages are lost and counted.
///
/// A chunk is written at most `kChunkAge` after its first message arrived: a crash of the process
/// loses no more than that.
///
/// In simulated time nothing polls: `take` is called after each round, and waits if memory is
/// exhausted, so that nothing is lost.
///
/// @threads  Confined to the control thread; `take` to that of the simulation.
class Recorder {
 public:
  static constexpr std::chrono::milliseconds kPoll{5};
  static constexpr std::chrono::milliseconds kChunkAge{40};
  static constexpr std::uint64_t kChunkBytes = std::uint64_t{1} << 20U;
  static constexpr std::uint64_t kLargeBytes = std::uint64_t{128} << 10U;

  Recorder(RecorderOptions options, const base::Clock& clock);
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;
  ~Recorder();

  /// Taps the selected topics; call before they are connected.
  void tap(detail::Topics& topics);

  /// Called with a sentence when a file can no longer be written or is gone, when recording
  /// continues, and for the first too large message of a publisher; on the recorder's threads, and
  /// at the end on that of `stop`. Set before the start.
  std::function<void(const std::string&)> on_trouble = [](const std::string&) {};

  /// Starts, once the topics are connected and before anything is published. False if no file can
  /// be created: see `problem`; then everything is lost and counted, until one can be.
  [[nodiscard]] bool start(Explanation explanation, Activity activity);

  /// Takes pending messages; in simulated time after each round, with the round's index in its
  /// moment.
  void take(std::uint32_t step = 0);

  /// Records what is left, and closes the file with `end` as its metadata `fastcycle.end`. A second
  /// call does nothing.
  void stop(std::map<std::string, std::string> end = {});

  [[nodiscard]] std::vector<RecordedTopic> topics() const;
  [[nodiscard]] std::uint64_t activations_lost() const { return activations_lost_; }
  /// Reads of components that were overwritten before they were recorded.
  [[nodiscard]] std::uint64_t reads_lost() const { return reads_lost_; }
  /// The last message of `on_trouble`; empty if there was none. Safe.
  ///
  /// @realtime No lock, no system call.
  [[nodiscard]] std::string trouble() const;
  /// Once stopped.
  [[nodiscard]] const std::vector<std::filesystem::path>& files() const {
    return recording_.files();
  }
  /// Whether anything could not be written, or is not at the requested place. Once stopped.
  [[nodiscard]] bool has_failed() const { return has_failed_; }
  /// The last error of the files; empty if there was none. Once stopped, or before the start.
  [[nodiscard]] const std::string& problem() const { return recording_.problem(); }

 private:
  /// Counters of a topic, updated by both threads.
  struct Topic {
    std::string name;
    std::atomic<std::uint64_t> recorded{0};
    std::atomic<std::uint64_t> bytes{0};
    std::atomic<std::uint64_t> memory{0};
    std::atomic<std::uint64_t> disk{0};
    std::atomic<std::uint64_t> too_large{0};
  };

  /// A topic's data in one file.
  struct Written {
    std::uint64_t messages = 0;
    std::uint64_t bytes = 0;
  };

  /// State of a stream.
  struct StreamState {
    std::size_t open = 0;  ///< Index in `open_` for its small messages.
    std::atomic<std::size_t> held{0};
    bool is_reported = false;  ///< A too large message was reported.
  };

  /// The last messages of a publisher of a latched topic, as far as they are in a file.
  struct Latched {
    std::size_t count = 0;
    std::deque<StoredMessage> last;
  };

  /// Small messages with the same compression.
  struct Open {
    mcap::ChunkOptions options;
    std::unique_ptr<Batch> batch;
  };

  void define();
  [[nodiscard]] std::size_t open_for(const std::string& topic);
  void poll();
  void take_message(const Stream& stream, detail::Envelope* envelope);
  void refuse(const Stream& stream, std::uint64_t bytes);
  void add_small(const Stream& stream, const detail::Envelope& envelope, std::uint64_t bytes);
  void add_large(const Stream& stream, detail::Envelope* envelope, std::uint64_t bytes);
  void take_activations();
  void note(Batch& batch, const Stream& stream, const detail::Envelope& envelope,
            std::uint64_t bytes);
  void add_own(Batch& batch, std::uint16_t channel, const google::protobuf::Message& message);
  void hand_over(std::unique_ptr<Batch> batch);
  void hand_over_what_is_due(bool all);
  [[nodiscard]] std::unique_ptr<Batch> new_batch(const mcap::ChunkOptions& options);
  [[nodiscard]] bool make_room(const Stream& stream, std::uint64_t bytes, bool is_large);
  void set(bool& flag);
  void write_batches();
  void write(Batch& batch);
  void take_file_news(bool goes_on);
  void report_trouble(const std::string& text);
  [[nodiscard]] std::uint64_t count_as_lost(const std::filesystem::path& active);
  void report(bool is_written, std::uint64_t messages);
  void explain(mcap::Writer& writer);
  void conclude(mcap::Writer& writer);

  // Constant once started.
  const RecorderOptions options_;
  const base::Clock& clock_;
  Streams streams_{"recorder"};
  Explanation explanation_;
  std::map<std::string, std::string> end_;
  std::vector<std::unique_ptr<StreamState>> states_;  ///< By `Stream::index`.
  std::vector<std::unique_ptr<Topic>> topics_;

  // Of the taking thread.
  std::vector<Open> open_;
  Serializer serializer_;
  ActivationReader activations_;
  std::array<std::uint32_t, 3> own_sequences_{};  ///< By channel, for those that are no topic's.
  std::optional<std::uint32_t> round_;  ///< Simulated time: the round being taken, in its moment.
  std::atomic<std::uint64_t> activations_lost_{0};
  std::atomic<std::uint64_t> reads_lost_{0};

  // Past messages; under `mutex_`, except the last one. Never erased.
  static constexpr std::size_t kTroublesMax = 256;
  std::deque<std::string> troubles_;
  std::atomic<const std::string*> trouble_{nullptr};

  // Shared by both threads.
  mutable std::mutex mutex_;
  std::condition_variable came_;
  std::condition_variable went_;
  std::condition_variable ended_;
  std::deque<std::unique_ptr<Batch>> batches_;
  std::uint64_t waiting_bytes_ = 0;
  bool stops_taking_ = false;
  bool stops_writing_ = false;

  // Of the writing thread.
  std::map<std::uint16_t, Latched> latched_;  ///< By channel.
  Recording recording_;
  /// By topic, for files that may still be lost, by their names while being written.
  std::map<std::filesystem::path, std::vector<Written>> written_;
  bool has_failed_ = false;
  bool is_in_trouble_ = false;
  std::uint64_t lost_in_trouble_ = 0;

  bool is_started_ = false;
  std::vector<base::Refusal> refusals_;
  base::Thread writing_;
  base::Thread polling_;
};

}  // namespace fastcycle::record

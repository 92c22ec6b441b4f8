#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "broker/read_ring.h"
#include "broker/topics.h"
#include "executor/activation_ring.h"
#include "executor/peer_activity.h"
#include "mcap/records.h"
#include "mcap/topic_filter.h"
#include "mcap/writer.h"
#include "record/tap.h"

namespace fastcycle::log {
class Activations;
class MessageInfo;
}  // namespace fastcycle::log

namespace fastcycle::record {

/// Channels of FastCycle itself; those of publishers follow.
inline constexpr std::uint16_t kActivationsChannel = 1;
inline constexpr std::uint16_t kInfosChannel = 2;

/// What a reader on another machine needs; written at the beginning of each file.
struct Explanation {
  std::map<std::string, std::string> facts = {};  ///< The metadata `fastcycle.run`.
  std::string application = {};                   ///< JSON: the attachment `application.json`.
};

/// One publisher of one topic.
struct Stream {
  const detail::Lane* lane = nullptr;
  std::uint16_t channel = 0;
  std::size_t index = 0;    ///< In `Streams::all`.
  std::size_t topic = 0;    ///< In `Streams::topics`.
  std::size_t latched = 0;  ///< Messages that later subscribers get first.
  bool is_external = false;
  std::string publisher = {};  ///< The component that publishes.
  std::size_t may_hold = 0;    ///< Limit of its messages held at once.
};

/// The topics that an observer of the broker receives, and their schemas and channels for a file.
///
///     Streams streams("recorder");
///     streams.tap(topics, filter, memory_bytes);   // before the topics are connected
///     streams.define();                            // after that
///     streams.take([](const Stream& stream, const detail::Lane::Head& head) { ... });
///
/// @threads  `take` by one thread, all else by the control thread before that; members that are
///           constant after `define` are Safe.
class Streams {
 public:
  /// `name` identifies the observer in ledgers and reports.
  explicit Streams(std::string name) : tap_(std::move(name)) {}

  /// Subscribes to the topics selected by `filter`. If the size of messages is known, the queue of
  /// each publisher is limited to an eighth of `memory_bytes`, and so are the messages held after
  /// they were taken, with at most `hold_max`.
  void tap(detail::Topics& topics, const mcap::TopicFilter& filter, std::uint64_t memory_bytes,
           std::size_t hold_max);
  void define();

  /// Calls `give(stream, head)` for each pending message; the callee owns the reference to the
  /// envelope.
  template <typename Give>
  void take(const Give& give) {
    tap_.take([&](const detail::Lane& lane, const detail::Lane::Head& head) {
      give(streams_[index_of_lane_.at(&lane)], head);
    });
  }

  [[nodiscard]] const std::vector<Stream>& all() const { return streams_; }
  [[nodiscard]] const std::vector<std::string>& topics() const { return topics_; }
  /// Whether messages of `publisher` are excluded.
  [[nodiscard]] bool leaves_out(PublisherId publisher) const {
    return left_out_.contains(publisher);
  }

  /// Writes the beginning of a file.
  void explain(mcap::Writer& writer, const Explanation& explanation, Time now) const;

 private:
  std::uint16_t schema_of(const google::protobuf::Descriptor& type);
  void add_channel(std::uint16_t id, const std::string& topic,
                   const google::protobuf::Descriptor& type,
                   std::map<std::string, std::string> metadata);
  void add_stream(const detail::Lane& lane);

  Tap tap_;
  std::vector<Stream> streams_;
  std::unordered_map<const detail::Lane*, std::size_t> index_of_lane_;
  std::vector<std::string> topics_;
  std::unordered_set<PublisherId> left_out_;
  std::vector<mcap::Schema> schemas_;
  std::vector<mcap::Channel> channels_;
};

/// Where the activity of an application's components is recorded.
struct Activity {
  std::vector<const detail::ActivationRing*> rings = {};  ///< One per worker.
  /// One per component, in the order of the application file; null, or missing, if not recorded.
  std::vector<const detail::ReadRing*> reads = {};
  std::vector<const detail::PeerActivity*> peers = {};  ///< The other processes.
};

/// What one activation read beside its cause.
struct SeenReads {
  std::span<const detail::Read> reads = {};
  std::uint64_t lost = 0;  ///< Of its component, since the last call.
};

/// New activations of one worker.
struct NewActivations {
  std::size_t worker = 0;         ///< Among those of all processes, this one's first.
  std::uint32_t incarnation = 1;  ///< Of its process.
  std::uint64_t lost = 0;         ///< Overwritten before they were read; they precede `records`.
  std::span<const detail::ActivationRecord> records = {};
};

/// Reads the new activations of all workers, and what they read.
///
/// @threads  Confined.
class ActivationReader {
 public:
  ActivationReader() = default;
  explicit ActivationReader(Activity activity);

  /// Calls `give(activations)` for each worker with new activations. In it, `seen_in` returns what
  /// each activation read.
  template <typename Give>
  void read(const Give& give) {
    std::size_t first = 0;
    for (Part& part : parts_) {
      part_ = &part;
      do {
        take(part);
        for (std::size_t worker = 0; worker < part.workers.size(); ++worker) {
          const Worker& its = part.workers[worker];
          if (its.lost > 0 || !its.records.empty()) {
            give(NewActivations{.worker = first + worker,
                                .incarnation = part.incarnation,
                                .lost = its.lost,
                                .records = its.records});
          }
        }
      } while (begin_next(part));
      first += part.workers.size();
    }
  }

  [[nodiscard]] SeenReads seen_in(const detail::ActivationRecord& record);

 private:
  /// Data read from one worker's ring.
  struct Worker {
    std::uint64_t next = 0;
    std::uint64_t lost = 0;
    std::vector<detail::ActivationRecord> records = {};
  };
  /// Data read from one component's ring, for activations that were returned recently or not yet.
  struct Reads {
    std::uint64_t next = 0;
    std::uint64_t lost = 0;
    std::uint64_t given = 0;  ///< The number of its newest activation that was returned.
    std::uint64_t old = 0;    ///< The same, one pass ago.
    /// The smallest number of this pass's activations, which may be of several workers: the losses
    /// may concern any of them.
    std::uint64_t first = 0;
    std::vector<detail::Read> reads = {};  ///< By activation.
  };
  /// One process, in its present incarnation.
  struct Part {
    const detail::PeerActivity* peer = nullptr;  ///< Null: this process.
    std::uint32_t incarnation = 1;               ///< 0: it has ended, or not started.
    std::uint32_t last = 0;                      ///< The present one, or the last one before it.
    std::uint32_t seen = 1;                      ///< The process's at the begin of this pass.
    detail::PeerActivity::Rings rings = {};
    std::vector<Worker> workers = {};
    std::vector<Reads> reads = {};
  };

  static void begin(Part& part, std::uint32_t incarnation);
  [[nodiscard]] static bool begin_next(Part& part);
  void take(Part& part);
  [[nodiscard]] bool take_activations(Part& part);
  static void take_last(Worker& worker, const detail::ActivationRing& ring);
  static void leave_out_others(const Part& part, Worker& worker);
  static void take_reads(Part& part);

  std::vector<Part> parts_;
  Part* part_ = nullptr;  ///< The one whose activations are being returned.
};

/// Records the incarnation of the process in which these activations ran.
void set_incarnation(log::Activations& activations, std::uint32_t incarnation);

/// Adds `record`, and what it read, to the log of one worker. `is_left_out`: the log does not have
/// the message that caused it.
void add(log::Activations& activations, const detail::ActivationRecord& record,
         const SeenReads& seen = {}, bool is_left_out = false);

/// The facts of a message that its record has no field for; nothing if all are default. `round`: in
/// simulated time, the index in its moment of the last round served.
[[nodiscard]] std::optional<log::MessageInfo> describe(const Stream& stream,
                                                       const MessageInfo& message,
                                                       std::optional<std::uint32_t> round);

/// The fields of a message record.
[[nodiscard]] mcap::MessageHead head_of(const Stream& stream, const MessageInfo& message);

/// `time` in the format of the log.
[[nodiscard]] std::uint64_t to_log_time(Time time);

}  // namespace fastcycle::record

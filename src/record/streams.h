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

/// The channels of what is not a topic's; those of publishers follow.
inline constexpr std::uint16_t kActivationsChannel = 1;
inline constexpr std::uint16_t kInfosChannel = 2;

/// What explains the log on another machine: written at the beginning of each file.
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
  std::size_t may_hold = 0;    ///< How many of its messages may be held at once.
};

/// What an observer of the broker listens to, and what explains it in a file: schemas and channels.
///
///     Streams streams("recorder");
///     streams.tap(topics, filter, memory_bytes);   // before the topics are connected
///     streams.define();                            // after that
///     streams.take([](const Stream& stream, const detail::Lane::Head& head) { ... });
///
/// @threads  `take` by one thread, all else by the control thread before that; what is constant
///           once defined is Safe.
class Streams {
 public:
  /// `name` stands for the observer in ledgers and reports.
  explicit Streams(std::string name) : tap_(std::move(name)) {}

  /// Listens to the topics that `filter` wants. Where the size of messages is known, those that
  /// wait of one publisher take no more than an eighth of `memory_bytes`, and so do those that are
  /// held once they were taken, `hold_max` at most.
  void tap(detail::Topics& topics, const mcap::TopicFilter& filter, std::uint64_t memory_bytes,
           std::size_t hold_max);
  void define();

  /// Calls `give(stream, head)` for what waits; the reference to the envelope is then the callee's.
  template <typename Give>
  void take(const Give& give) {
    tap_.take([&](const detail::Lane& lane, const detail::Lane::Head& head) {
      give(streams_[index_of_lane_.at(&lane)], head);
    });
  }

  [[nodiscard]] const std::vector<Stream>& all() const { return streams_; }
  [[nodiscard]] const std::vector<std::string>& topics() const { return topics_; }
  /// Whether the messages of `publisher` are left out.
  [[nodiscard]] bool leaves_out(PublisherId publisher) const {
    return left_out_.contains(publisher);
  }

  /// Writes what a file begins with.
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

/// Where the components of an application leave what they do.
struct Activity {
  std::vector<const detail::ActivationRing*> rings = {};  ///< One a worker.
  /// One a component, in the order of the application file; null, or missing, where nobody keeps
  /// them.
  std::vector<const detail::ReadRing*> reads = {};
  std::vector<const detail::PeerActivity*> peers = {};  ///< The other processes.
};

/// What one activation learned beside its cause.
struct SeenReads {
  std::span<const detail::Read> reads = {};
  std::uint64_t lost = 0;  ///< Of its component, since it was asked last.
};

/// What is new of one worker.
struct NewActivations {
  std::size_t worker = 0;         ///< Counts the workers of all processes, those of this one first.
  std::uint32_t incarnation = 1;  ///< Of its process.
  std::uint64_t lost = 0;  ///< Written over before they were read; they came before `records`.
  std::span<const detail::ActivationRecord> records = {};
};

/// Reads the activations of all workers, each from where it was, with what they learned.
///
/// @threads  Confined.
class ActivationReader {
 public:
  ActivationReader() = default;
  explicit ActivationReader(Activity activity);

  /// Calls `give(activations)` for each worker of which there is something new. In it, `seen_in`
  /// tells what each learned.
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
  /// What one worker's ring had.
  struct Worker {
    std::uint64_t next = 0;
    std::uint64_t lost = 0;
    std::vector<detail::ActivationRecord> records = {};
  };
  /// What one component's ring had, of activations that were not given for long.
  struct Reads {
    std::uint64_t next = 0;
    std::uint64_t lost = 0;
    std::uint64_t given = 0;  ///< The number of its newest activation that was given.
    std::uint64_t old = 0;    ///< The same, one look ago.
    /// The smallest number of this look's activations, which may be of several workers: what was
    /// lost may have been of any of them.
    std::uint64_t first = 0;
    std::vector<detail::Read> reads = {};  ///< By activation.
  };
  /// One process, in its present incarnation.
  struct Part {
    const detail::PeerActivity* peer = nullptr;  ///< Null: this process.
    std::uint32_t incarnation = 1;               ///< 0: it has ended, or not begun.
    std::uint32_t last = 0;                      ///< The present one, or the last one before it.
    std::uint32_t seen = 1;  ///< The process's incarnation before this look: if another, its last.
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
  Part* part_ = nullptr;  ///< Whose activations are being given.
};

/// Says in which incarnation of their process these activations were.
void set_incarnation(log::Activations& activations, std::uint32_t incarnation);

/// Adds `record`, and what it saw, to what a log says of one worker. `is_left_out`: the log does
/// not have the message that caused it.
void add(log::Activations& activations, const detail::ActivationRecord& record,
         const SeenReads& seen = {}, bool is_left_out = false);

/// What a message record has no place for; nothing if that is as usual. `round` is in simulated
/// time the place of the round, in its moment, that was served last.
[[nodiscard]] std::optional<log::MessageInfo> describe(const Stream& stream,
                                                       const MessageInfo& message,
                                                       std::optional<std::uint32_t> round);

/// What a message record says.
[[nodiscard]] mcap::MessageHead head_of(const Stream& stream, const MessageInfo& message);

/// `time` as the format has it.
[[nodiscard]] std::uint64_t to_log_time(Time time);

}  // namespace fastcycle::record

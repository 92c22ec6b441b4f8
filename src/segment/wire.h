#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <google/protobuf/message.h>
#include <pthread.h>

#include "broker/read_ring.h"
#include "broker/trail.h"
#include "executor/activation_ring.h"
#include "fastcycle/message.h"
#include "segment/segments.h"

namespace fastcycle::segment {

/// See `LinkPlan::depth_of_large`. Serialized.
constexpr std::uint64_t kBytesOut = std::uint64_t{16} << 20U;

/// The way of one publisher's messages to one process that subscribes to them: a queue of at most
/// `depth` messages, of which, with those that the receiver holds, at most `capacity` are out.
struct LinkPlan {
  ProcessIndex from = 0;
  ProcessIndex to = 0;
  std::uint32_t depth = 16;
  std::uint32_t capacity = 64;  ///< Above `depth`, below 65536.
  /// Above it no message may wait while `kBytesOut` are out: the new one is dropped. A receiver
  /// that stands still holds many small messages, but not all memory.
  std::uint32_t depth_of_large = 16;
  unsigned executor = 0;      ///< Of the receiver: whose workers take the messages.
  bool drops_newest = false;  ///< When it is full; else the oldest that was not taken.

  // Set by `WirePlan::lay_out`.
  std::size_t out_offset = 0;  ///< Of `LinkOut` in the control area of `from`.
  std::size_t in_offset = 0;   ///< Of `LinkIn` in that of `to`.
};

/// What all processes of an application share, and where it lies: made before the first of them.
struct WirePlan {
  unsigned processes = 0;  ///< With the one that makes the others.
  unsigned executors = 0;  ///< The most that any of them has.
  std::size_t roots = 0;   ///< Of latency chains.
  std::size_t components = 0;
  std::vector<LinkPlan> links;
  /// Where somebody records what all do: how many workers each process has. Else empty.
  std::vector<unsigned> workers = {};
  /// Where what one component learns is kept then.
  struct Reads {
    ProcessIndex process = 0;
    std::size_t offset = 0;  ///< Set by `lay_out`.
  };
  std::vector<Reads> reads = {};  ///< By component.
  /// The same of its process's standby; process 0: it has none.
  std::vector<Reads> reads_on_standby = {};

  // Set by `lay_out`.
  std::vector<std::size_t> ring_offsets = {};  ///< By process: the rings of its workers.
  std::vector<std::size_t> life_offsets = {};  ///< The same: their lives.
  std::size_t control_bytes = 0;
  void lay_out();
};

// Every shared word has one writer, and lies in the writer's segment. A reader that a word misleads
// does itself harm at most: what decides about memory is private to its owner.

/// What one message is, beside its payload. The publisher's.
struct WireMessage {
  const google::protobuf::Message* payload;
  MessageInfo info;
  /// Where it stands in the queue, and to which incarnation of the receiver it was given; the
  /// latter is written last. So a receiver that was made anew takes nothing that was meant for the
  /// one before.
  std::atomic<std::uint64_t> position;
  std::atomic<std::uint32_t> receiver;
};

/// The publisher's end of a link: this, then `slots`, messages, and trails.
struct LinkOut {
  alignas(64) std::atomic<std::uint64_t> tail;
  std::atomic<std::uint64_t> sequence;  ///< Of the last message that was published.
  /// Position << 16 | number of the message, or `kClosing`; behind it, as many as `slot_count`.
  static constexpr std::uint64_t kClosing = ~std::uint64_t{0};
};

// Words of slots and of returns.
constexpr unsigned kPositionShift = 16;
[[nodiscard]] constexpr std::uint64_t to_word(std::uint64_t position,
                                              std::uint64_t number) noexcept {
  return position << kPositionShift | number;
}
[[nodiscard]] constexpr std::uint64_t position_of(std::uint64_t word) noexcept {
  return word >> kPositionShift;
}
[[nodiscard]] constexpr std::uint64_t number_of(std::uint64_t word) noexcept {
  return word & ((std::uint64_t{1} << kPositionShift) - 1);
}
/// A return tells by its highest bit whether it was written in this lap around the ring.
[[nodiscard]] constexpr std::uint64_t lap_of_return(std::uint64_t place,
                                                    std::uint64_t count) noexcept {
  return ((place / count + 1) & 1) << 63;
}
constexpr std::uint64_t kLapBit = std::uint64_t{1} << 63;

/// The receiver's end: this, then a ring of returns for each generation of the publisher.
struct LinkIn {
  alignas(64) std::atomic<std::uint64_t> taking;  ///< Messages up to here are its.
  /// Incarnation of the publisher << 32 | its own: whom it reads, and since when.
  std::atomic<std::uint64_t> ready;
  /// The oldest incarnation of the publisher of which it holds a message.
  std::atomic<std::uint32_t> oldest;
};

/// A word that is counted up, and slept on.
struct alignas(64) Bell {
  std::atomic<std::uint32_t> word;
};

/// What a process says to all others of rounds of simulated time: that it came to one more point at
/// which all wait for each other, and what it knows there.
struct alignas(64) RoundWords {
  static constexpr std::size_t kFacts = 8;

  std::atomic<std::uint32_t> count;     ///< Points that it came to. Slept on.
  std::atomic<std::uint32_t> sleepers;  ///< Whether it sleeps until others come.
  /// Whether it was restarted, and starts its components before it comes to the first point.
  std::atomic<std::uint32_t> is_joining;
  /// By the lowest bit of the count: what was said at the last point stays readable until all came
  /// to the next one.
  std::atomic<std::uint64_t> facts[2][kFacts];
};

/// What a process says to all others of the application as a whole: records behind each other.
struct alignas(64) NoticeWords {
  static constexpr std::size_t kWords = std::size_t{1} << 15U;

  /// How many words are written, or will be before `end` says so.
  std::atomic<std::uint64_t> begun;
  std::atomic<std::uint64_t> end;    ///< How many words of whole records there are, in all.
  std::atomic<std::uint32_t> count;  ///< Of records. Slept on.
  std::atomic<std::uint64_t> ring[kWords];
};

/// What a process that is restarted must know of what was said before: a text that is replaced.
struct alignas(64) SnapshotWords {
  static constexpr std::size_t kWords = std::size_t{1} << 13U;

  std::atomic<std::uint64_t> version;  ///< Odd while it is written; 0: there is none.
  std::atomic<std::uint64_t> bytes;
  std::atomic<std::uint64_t> words[kWords];
};

/// What a process with a standby says to the other one of the two.
struct alignas(64) StandbyWords {
  /// The how manyth of both that publishes for others; 0: it follows the other one.
  std::atomic<std::uint32_t> epoch;
  std::atomic<std::uint32_t> progress;    ///< Counted up after each activation. Slept on.
  std::atomic<std::uint32_t> sleepers;    ///< Workers that sleep until the other one goes on.
  std::atomic<std::uint32_t> is_ending;   ///< It ends in order: nobody takes its place.
  std::atomic<std::uint32_t> is_in_step;  ///< It follows, and may take the other one's place.
  std::atomic<std::uint32_t> crashed;     ///< In whose activation it crashed: its place + 1.
  std::atomic<std::uint64_t> known;       ///< Activations of the other one that it knows of,
  std::atomic<std::uint64_t> executed;    ///< and of these, executed.
};

constexpr std::uint32_t kFollows = std::uint32_t{1} << 31U;

/// Held by a worker as long as it lives. The kernel tells of its end, before the memory of its
/// process goes.
struct alignas(64) WorkerLife {
  pthread_mutex_t mutex;
};

/// How far a component is; for processes that wait for each other's components.
enum class Stage : std::uint32_t { kNone, kStarted, kFailed, kStopped };

/// Finds these things in the segments.
///
/// @threads  Safe.
class Wire {
 public:
  Wire(const Segments& segments, const WirePlan& plan) : segments_(segments), plan_(plan) {}

  [[nodiscard]] static std::uint32_t slot_count(const LinkPlan& link) noexcept;
  [[nodiscard]] static std::uint32_t return_count(const LinkPlan& link) noexcept;
  [[nodiscard]] static unsigned generation_of(std::uint32_t incarnation) noexcept {
    return (incarnation + Segments::kGenerations - 1) % Segments::kGenerations;
  }

  // Of a process in its `incarnation`, which is counted from 1.
  [[nodiscard]] LinkOut& out(const LinkPlan& link, std::uint32_t incarnation) const noexcept {
    return at<LinkOut>(link.from, incarnation, link.out_offset);
  }
  [[nodiscard]] std::atomic<std::uint64_t>* slots(const LinkPlan& link,
                                                  std::uint32_t incarnation) const noexcept;
  [[nodiscard]] WireMessage* messages(const LinkPlan& link,
                                      std::uint32_t incarnation) const noexcept;
  /// `roots` of each message, in their order.
  [[nodiscard]] detail::Trail* trails(const LinkPlan& link,
                                      std::uint32_t incarnation) const noexcept;
  [[nodiscard]] LinkIn& in(const LinkPlan& link, std::uint32_t incarnation) const noexcept {
    return at<LinkIn>(link.to, incarnation, link.in_offset);
  }
  /// What is returned to `publisher`, an incarnation of the publishing process.
  [[nodiscard]] std::atomic<std::uint64_t>* returns(const LinkPlan& link, std::uint32_t incarnation,
                                                    std::uint32_t publisher) const noexcept;
  /// How many workers of `executor` may be asleep; the process's own.
  [[nodiscard]] std::atomic<std::uint32_t>& sleepers(ProcessIndex process,
                                                     std::uint32_t incarnation,
                                                     unsigned executor) const noexcept {
    return at<Bell>(process, incarnation, executor * sizeof(Bell)).word;
  }
  /// Rung by `from` when it has something for that executor of `to`.
  [[nodiscard]] std::atomic<std::uint32_t>& bell(ProcessIndex from, std::uint32_t incarnation,
                                                 ProcessIndex to,
                                                 unsigned executor) const noexcept {
    const std::size_t place = plan_.executors * (std::size_t{to} + 1) + executor;
    return at<Bell>(from, incarnation, place * sizeof(Bell)).word;
  }
  /// How far a component of the process is.
  [[nodiscard]] std::atomic<std::uint32_t>& stage(ProcessIndex process, std::uint32_t incarnation,
                                                  std::size_t component) const noexcept;

  [[nodiscard]] RoundWords& rounds(ProcessIndex process, std::uint32_t incarnation) const noexcept;

  [[nodiscard]] NoticeWords& notices(ProcessIndex process,
                                     std::uint32_t incarnation) const noexcept;
  [[nodiscard]] SnapshotWords& snapshot(ProcessIndex process,
                                        std::uint32_t incarnation) const noexcept;

  /// What a worker of the process does.
  [[nodiscard]] detail::ActivationRing& ring(ProcessIndex process, std::uint32_t incarnation,
                                             unsigned worker) const noexcept {
    return at<detail::ActivationRing>(
        process, incarnation,
        plan_.ring_offsets[process] + worker * sizeof(detail::ActivationRing));
  }
  /// The life of a worker of the process.
  [[nodiscard]] WorkerLife& life(ProcessIndex process, std::uint32_t incarnation,
                                 unsigned worker) const noexcept {
    return at<WorkerLife>(process, incarnation,
                          plan_.life_offsets[process] + worker * sizeof(WorkerLife));
  }
  [[nodiscard]] StandbyWords& standby(ProcessIndex process,
                                      std::uint32_t incarnation) const noexcept;

  /// What a component learns: of that incarnation of `process`, which is its own or the standby of
  /// that.
  [[nodiscard]] std::unique_ptr<detail::ReadRing> reads(ProcessIndex process, std::size_t component,
                                                        std::uint32_t incarnation) const {
    const bool is_standby = plan_.reads[component].process != process;
    const WirePlan::Reads& its = (is_standby ? plan_.reads_on_standby : plan_.reads)[component];
    return std::make_unique<detail::ReadRing>(&at<char>(its.process, incarnation, its.offset),
                                              kReads);
  }
  static constexpr std::size_t kReads = detail::ReadRing::kForViews;

  // Of the one that makes the others.
  /// Counted up when a process comes or goes.
  [[nodiscard]] std::atomic<std::uint32_t>& changes() const noexcept {
    return at<Bell>(0, 1, 0).word;
  }
  /// The incarnation of a process that is on its way, as it has ended and is restarted; else 0. In
  /// simulated time the others wait for it.
  [[nodiscard]] std::atomic<std::uint32_t>& restarting(ProcessIndex process) const noexcept {
    return at<Bell>(0, 1, (std::size_t{plan_.processes} + 1 + process) * sizeof(Bell)).word;
  }
  /// Of a process with a standby, as it is made now: which incarnation of the other one there is,
  /// or was last, and with `kFollows`, that it follows that one.
  [[nodiscard]] std::atomic<std::uint32_t>& begins_on_standby(ProcessIndex process) const noexcept {
    return at<Bell>(0, 1, (2 * std::size_t{plan_.processes} + 1 + process) * sizeof(Bell)).word;
  }
  /// The present incarnation of a process; 0: there is none.
  [[nodiscard]] std::atomic<std::uint32_t>& incarnation(ProcessIndex process) const noexcept {
    return at<Bell>(0, 1, (std::size_t{process} + 1) * sizeof(Bell)).word;
  }

  [[nodiscard]] const Segments& segments() const noexcept { return segments_; }
  [[nodiscard]] const WirePlan& plan() const noexcept { return plan_; }

 private:
  template <typename T>
  [[nodiscard]] T& at(ProcessIndex process, std::uint32_t incarnation,
                      std::size_t offset) const noexcept {
    return *reinterpret_cast<T*>(segments_.control(process, generation_of(incarnation)) + offset);
  }

  const Segments& segments_;
  const WirePlan& plan_;
};

/// Wakes up to `count` threads that sleep on `word`, in whatever process.
void wake(const std::atomic<std::uint32_t>& word, int count) noexcept;

}  // namespace fastcycle::segment

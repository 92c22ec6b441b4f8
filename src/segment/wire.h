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

/// The link from a publisher to one subscribing process: a queue of at most `depth` messages;
/// together with those that the receiver holds, at most `capacity` are out.
struct LinkPlan {
  ProcessIndex from = 0;
  ProcessIndex to = 0;
  std::uint32_t depth = 16;
  std::uint32_t capacity = 64;  ///< Above `depth`, below 65536.
  /// Beyond this many waiting messages, a new one is dropped while `kBytesOut` are out. So a
  /// receiver that hangs may hold many small messages, but not all memory.
  std::uint32_t depth_of_large = 16;
  unsigned executor = 0;      ///< Of the receiver, whose workers take the messages.
  bool drops_newest = false;  ///< If it is full; else the oldest one not taken.
  /// The publisher is not trusted: the receiver parses a copy of the serialized message.
  bool is_serialized = false;
  /// The publisher's credit window, if receivers there return credits; else 0.
  std::uint32_t credits = 0;
  unsigned publisher_executor = 0;  ///< Whose workers are notified of credits.

  // Set by `WirePlan::lay_out`.
  std::size_t out_offset = 0;  ///< Of `LinkOut` in the control area of `from`.
  std::size_t in_offset = 0;   ///< Of `LinkIn` in that of `to`.
};

/// Layout of the memory shared by all processes of an application: made before the first one
/// starts.
struct WirePlan {
  unsigned processes = 0;  ///< Including the supervisor.
  unsigned executors = 0;  ///< The maximum of all processes.
  std::size_t roots = 0;   ///< Of latency chains.
  std::size_t components = 0;
  /// Credits are passed on between rounds.
  bool is_simulated = false;
  std::vector<LinkPlan> links;
  /// If activity is recorded: the number of workers of each process. Else empty.
  std::vector<unsigned> workers = {};
  /// Where a component's reads are then recorded.
  struct Reads {
    ProcessIndex process = 0;
    std::size_t offset = 0;  ///< Set by `lay_out`.
  };
  std::vector<Reads> reads = {};  ///< By component.
  /// The same for the standby of its process.
  std::vector<Reads> reads_on_standby = {};

  // Set by `lay_out`.
  std::vector<std::size_t> ring_offsets = {};  ///< By process: the rings of its workers.
  std::vector<std::size_t> life_offsets = {};  ///< By process: the life words of its workers.
  std::size_t control_bytes = 0;
  void lay_out();
};

// Every shared word has one writer, and is in the writer's segment. A wrong word can only harm its
// reader: everything that decides about memory is private to its owner.

/// Facts about a message, beside its payload. Written by the publisher.
struct WireMessage {
  const google::protobuf::Message* payload;
  MessageInfo info;
  /// Of a serialized link, instead of `payload`: its bytes.
  std::atomic<const char*> bytes;
  std::atomic<std::uint64_t> byte_count;
  /// Its position in the queue, and the incarnation of the receiver it was sent to; the latter is
  /// stored last. So a restarted receiver takes no message sent to its predecessor.
  std::atomic<std::uint64_t> position;
  std::atomic<std::uint32_t> receiver;
};

/// The publisher's end of a link: this, then `slots`, messages, and trails.
struct LinkOut {
  alignas(64) std::atomic<std::uint64_t> tail;
  std::atomic<std::uint64_t> sequence;       ///< Of the last message published.
  std::atomic<std::uint32_t> awaits_credit;  ///< Whether it is to be notified of one.
  /// Position << 16 | number of the message, or `kClosing`; `slot_count` of them follow.
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
/// The highest bit of a return distinguishes this lap around the ring from the last.
[[nodiscard]] constexpr std::uint64_t lap_of_return(std::uint64_t place,
                                                    std::uint64_t count) noexcept {
  return ((place / count + 1) & 1) << 63;
}
constexpr std::uint64_t kLapBit = std::uint64_t{1} << 63;

/// The receiver's end: this, then a ring of returns for each generation of the publisher.
struct LinkIn {
  alignas(64) std::atomic<std::uint64_t> taking;  ///< Messages up to here are claimed.
  /// Incarnation of the publisher << 32 | its own: which one it reads, and since when.
  std::atomic<std::uint64_t> ready;
  /// The oldest incarnation of the publisher whose messages it still holds.
  std::atomic<std::uint32_t> oldest;
  /// Up to here the slowest receiver has finished; behind `taking`. With credits.
  std::atomic<std::uint64_t> finished;
};

/// A futex word that is incremented to wake its sleepers.
struct alignas(64) Bell {
  std::atomic<std::uint32_t> word;
};

/// State of a process in rounds of simulated time, for all others: the number of synchronization
/// points reached, and its facts there.
struct alignas(64) RoundWords {
  static constexpr std::size_t kFacts = 8;

  std::atomic<std::uint32_t> count;     ///< Points reached. Slept on.
  std::atomic<std::uint32_t> sleepers;  ///< Whether it sleeps to wait for others.
  /// Whether it was restarted, and is starting its components before its first point.
  std::atomic<std::uint32_t> is_joining;
  /// Indexed by the lowest bit of the count: facts of the last point stay readable until all have
  /// reached the next one.
  std::atomic<std::uint64_t> facts[2][kFacts];
};

/// Application-wide notices of a process, for all others: consecutive records.
struct alignas(64) NoticeWords {
  static constexpr std::size_t kWords = std::size_t{1} << 15U;

  /// Number of words written, or about to be written before `end` includes them.
  std::atomic<std::uint64_t> begun;
  std::atomic<std::uint64_t> end;    ///< Number of words of complete records, in all.
  std::atomic<std::uint32_t> count;  ///< Of records. Slept on.
  std::atomic<std::uint64_t> ring[kWords];
};

/// Summary of earlier notices for a restarted process: a text that is replaced.
struct alignas(64) SnapshotWords {
  static constexpr std::size_t kWords = std::size_t{1} << 13U;
  static constexpr std::size_t kBytes = kWords * sizeof(std::uint64_t);

  std::atomic<std::uint64_t> version;  ///< Odd during a write; 0: there is none.
  std::atomic<std::uint64_t> bytes;
  std::atomic<std::uint64_t> words[kWords];
};

/// State of a process in a standby pair, for the other one.
struct alignas(64) StandbyWords {
  /// Ordinal among the active processes of the pair; 0: it follows the other one.
  std::atomic<std::uint32_t> epoch;
  std::atomic<std::uint32_t> progress;    ///< Incremented after each activation. Slept on.
  std::atomic<std::uint32_t> sleepers;    ///< Workers that wait for progress of the other one.
  std::atomic<std::uint32_t> is_ending;   ///< It ends in order: no takeover.
  std::atomic<std::uint32_t> is_in_step;  ///< It follows, and is able to take over.
  std::atomic<std::uint32_t> crashed;     ///< Component in whose activation it crashed: index + 1.
  std::atomic<std::uint64_t> known;       ///< Known activations of the other one,
  std::atomic<std::uint64_t> executed;    ///< and those of them executed.
};

constexpr std::uint32_t kFollows = std::uint32_t{1} << 31U;

/// Held by a worker as long as it lives. The kernel signals its end before the memory of its
/// process is released.
struct alignas(64) WorkerLife {
  pthread_mutex_t mutex;
};

/// Lifecycle of a component, for processes that wait for each other's components.
enum class Stage : std::uint32_t { kNone, kStarted, kFailed, kStopped };

/// Locates these structures in the segments.
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

  // Of a process in its `incarnation`, counted from 1.
  [[nodiscard]] LinkOut& out(const LinkPlan& link, std::uint32_t incarnation) const noexcept {
    return at<LinkOut>(link.from, incarnation, link.out_offset);
  }
  [[nodiscard]] std::atomic<std::uint64_t>* slots(const LinkPlan& link,
                                                  std::uint32_t incarnation) const noexcept;
  [[nodiscard]] WireMessage* messages(const LinkPlan& link,
                                      std::uint32_t incarnation) const noexcept;
  /// `roots` trails per message, in order.
  [[nodiscard]] detail::Trail* trails(const LinkPlan& link,
                                      std::uint32_t incarnation) const noexcept;
  [[nodiscard]] LinkIn& in(const LinkPlan& link, std::uint32_t incarnation) const noexcept {
    return at<LinkIn>(link.to, incarnation, link.in_offset);
  }
  /// Returns to `publisher`, an incarnation of the publishing process.
  [[nodiscard]] std::atomic<std::uint64_t>* returns(const LinkPlan& link, std::uint32_t incarnation,
                                                    std::uint32_t publisher) const noexcept;
  /// Number of sleeping workers of `executor`, an upper bound; the process's own.
  [[nodiscard]] std::atomic<std::uint32_t>& sleepers(ProcessIndex process,
                                                     std::uint32_t incarnation,
                                                     unsigned executor) const noexcept {
    return at<Bell>(process, incarnation, executor * sizeof(Bell)).word;
  }
  /// Rung by `from` when that executor of `to` has input, or a credit that it awaits.
  [[nodiscard]] std::atomic<std::uint32_t>& bell(ProcessIndex from, std::uint32_t incarnation,
                                                 ProcessIndex to,
                                                 unsigned executor) const noexcept {
    const std::size_t place = plan_.executors * (std::size_t{to} + 1) + executor;
    return at<Bell>(from, incarnation, place * sizeof(Bell)).word;
  }
  /// Lifecycle stage of a component of the process.
  [[nodiscard]] std::atomic<std::uint32_t>& stage(ProcessIndex process, std::uint32_t incarnation,
                                                  std::size_t component) const noexcept;

  [[nodiscard]] RoundWords& rounds(ProcessIndex process, std::uint32_t incarnation) const noexcept;

  [[nodiscard]] NoticeWords& notices(ProcessIndex process,
                                     std::uint32_t incarnation) const noexcept;
  [[nodiscard]] SnapshotWords& snapshot(ProcessIndex process,
                                        std::uint32_t incarnation) const noexcept;

  /// Activity of a worker of the process.
  [[nodiscard]] detail::ActivationRing& ring(ProcessIndex process, std::uint32_t incarnation,
                                             unsigned worker) const noexcept {
    return at<detail::ActivationRing>(
        process, incarnation,
        plan_.ring_offsets[process] + worker * sizeof(detail::ActivationRing));
  }
  /// Life word of a worker of the process.
  [[nodiscard]] WorkerLife& life(ProcessIndex process, std::uint32_t incarnation,
                                 unsigned worker) const noexcept {
    return at<WorkerLife>(process, incarnation,
                          plan_.life_offsets[process] + worker * sizeof(WorkerLife));
  }
  [[nodiscard]] StandbyWords& standby(ProcessIndex process,
                                      std::uint32_t incarnation) const noexcept;

  /// Reads of a component in that incarnation of `process`, which is its own or the standby's.
  [[nodiscard]] std::unique_ptr<detail::ReadRing> reads(ProcessIndex process, std::size_t component,
                                                        std::uint32_t incarnation) const {
    const bool is_standby = plan_.reads[component].process != process;
    const WirePlan::Reads& its = (is_standby ? plan_.reads_on_standby : plan_.reads)[component];
    return std::make_unique<detail::ReadRing>(&at<char>(its.process, incarnation, its.offset),
                                              kReads);
  }
  static constexpr std::size_t kReads = detail::ReadRing::kForViews;

  // Of the supervisor.
  /// Incremented when a process starts or ends.
  [[nodiscard]] std::atomic<std::uint32_t>& changes() const noexcept {
    return at<Bell>(0, 1, 0).word;
  }
  /// The next incarnation of a process that has ended and is being restarted; else 0. In simulated
  /// time the others wait for it.
  [[nodiscard]] std::atomic<std::uint32_t>& restarting(ProcessIndex process) const noexcept {
    return at<Bell>(0, 1, (std::size_t{plan_.processes} + 1 + process) * sizeof(Bell)).word;
  }
  /// Of a process with a standby, when it is started: the present or last incarnation of the other
  /// one, and `kFollows` if it follows that one.
  [[nodiscard]] std::atomic<std::uint32_t>& begins_on_standby(ProcessIndex process) const noexcept {
    return at<Bell>(0, 1, (2 * std::size_t{plan_.processes} + 1 + process) * sizeof(Bell)).word;
  }
  /// The present incarnation of a process; 0: none.
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

/// Wakes up to `count` threads that sleep on `word`, in any process.
void wake(const std::atomic<std::uint32_t>& word, int count) noexcept;

}  // namespace fastcycle::segment

#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "broker/message_export.h"
#include "broker/trail.h"
#include "fastcycle/detail/envelope.h"

namespace fastcycle::detail {

/// How returned messages are poisoned until they are lent again, to expose references that were
/// kept beyond the callback.
enum class Poison : std::uint8_t {
  kOff,      ///< It is unchanged, and keeps its capacity.
  kPattern,  ///< It is destroyed, and its own bytes are `kPoisonByte` for a while.
  kFree,     ///< It is destroyed and freed: a memory checker reports its use.
};
inline constexpr unsigned char kPoisonByte = 0xfc;

/// The value of the environment variable FASTCYCLE_POISON (off, pattern, free); without it, or with
/// any other value, `kFree` under AddressSanitizer, `kOff` where NDEBUG is defined, `kPattern`
/// otherwise.
[[nodiscard]] Poison poison_of_environment() noexcept;

/// The messages that one publisher lends.
///
/// Readers on any thread push released messages on a stack; the owner takes the whole stack at
/// once. Since no thread pops single entries, there is no ABA problem. The owner's free list is
/// last-in first-out: the warmest message is lent first.
///
/// A pool outlives its publisher until its last message was returned.
///
/// @threads  `give_back` is Safe; all else is confined to the publisher.
/// @realtime `take` and `give_back` allocate nothing and take no lock. `grow` allocates.
class Pool {
 public:
  /// A pool whose envelopes own messages like `default_instance`; null for envelopes that only
  /// forward. Each has `trails` trails.
  explicit Pool(const google::protobuf::Message* default_instance, std::size_t trails = 0,
                Poison poison = poison_of_environment());

  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  /// Adds `count` envelopes; their messages are copies of `prototype`, cleared but with its
  /// capacity, so that a first publish of that size causes no page fault. It must outlive the last
  /// `take`.
  void grow(std::size_t count, const google::protobuf::Message* prototype = nullptr);

  /// Enables counting of the samples that each of `count` holders keeps, and of `late_count` more,
  /// whose counters are allocated when the first of them is declared; before anything is published.
  void distinguish_holders(std::size_t count, std::size_t late_count);
  /// Allocates the counters of the late holders now.
  void provide_for_late_holders();
  /// How many messages `holder` keeps beyond its callbacks. Safe.
  [[nodiscard]] std::size_t kept_by(Holder holder) const noexcept {
    const Kept* const kept = find_kept(holder);
    return kept == nullptr ? 0 : kept->count();
  }
  /// Sets how many messages `holder` declares to keep; before it receives any.
  void declare_kept(Holder holder, std::size_t count);
  /// Whether a holder ever kept more than it declared, with a tolerance of `kToleratedKept`.
  [[nodiscard]] bool is_overdrawn() const noexcept {
    return is_overdrawn_.load(std::memory_order_relaxed);
  }
  /// See `keep` and `let_go` of envelope.h. Safe.
  void count_kept(Envelope& envelope, Holder holder) noexcept;
  void count_let_go(Envelope& envelope, Holder holder) noexcept;

  /// `holder` forwards a message of this pool in `forward`, and counts as keeping it until all its
  /// receivers have released it. By the publisher of `holder`, one thread at a time, unless the
  /// message was forwarded to it.
  void count_forwarded(Envelope& forward, Holder holder) noexcept;
  /// `forward` was returned. Safe.
  void count_came_back(const Envelope& forward) noexcept;

  /// A free envelope, or null if all are out.
  [[nodiscard]] Envelope* take() noexcept;

  /// Makes `take` use only what the last `collect` found: in simulated time, returns during a round
  /// must not affect how many messages there are.
  void collect_by_hand() noexcept { is_collected_by_hand_ = true; }
  /// Moves returned messages to the free list.
  void collect() noexcept;

  /// Sends returned envelopes to `sink`, which owns them: for messages of others. Before anything
  /// is taken.
  void send_back_to(ReturnSink& sink) noexcept { sink_ = &sink; }
  /// Reconstructs the free messages, in the memory where the thread allocates now.
  void make_free_ones_anew();

  /// Takes back a message that the owner did not publish.
  void put_back(Envelope* envelope) noexcept;

  /// Takes back an envelope without references.
  void give_back(Envelope* envelope) noexcept;

  /// Ends the owner's use: frees the free messages now, and the others when they are returned; the
  /// last one frees the pool.
  void close() noexcept;

  /// The number of envelopes ever allocated.
  [[nodiscard]] std::size_t size() const noexcept { return size_.load(std::memory_order_relaxed); }

 private:
  /// Envelopes that were allocated together.
  struct Slab {
    std::size_t count;
    std::unique_ptr<Envelope[]> envelopes;
    std::unique_ptr<Trail[]> trails;
    std::unique_ptr<std::atomic<std::uint32_t>[]> kept_samples;
  };

  /// One that is kept until the next arrives, and both during the exchange.
  static constexpr std::size_t kToleratedKept = 2;

  /// The messages that one holder keeps.
  struct Kept {
    /// Messages of which it keeps at least one sample.
    alignas(64) std::atomic<std::uint32_t> messages{0};
    std::atomic<std::uint32_t> forwarded{0};  ///< Written by `holder` alone.
    std::atomic<std::size_t> declared{0};     ///< Written again when it subscribes again.
    /// Forwarded ones that were returned; on a line of its own, as any thread may write it.
    alignas(64) std::atomic<std::uint32_t> came_back{0};

    [[nodiscard]] std::size_t count() const noexcept {
      const std::uint32_t back = came_back.load(std::memory_order_acquire);
      const std::uint32_t away = forwarded.load(std::memory_order_relaxed) - back;
      return messages.load(std::memory_order_relaxed) + std::size_t{away};
    }
    [[nodiscard]] bool is_too_much() const noexcept {
      return count() > declared.load(std::memory_order_relaxed) + kToleratedKept;
    }
  };
  ~Pool();

  /// Null for holders whose messages are not counted.
  [[nodiscard]] Kept* find_kept(Holder holder) const noexcept {
    if (holder < holder_count_) {
      return &kept_[holder];
    }
    Kept* const late = late_kept_.load(std::memory_order_acquire);
    return late != nullptr && holder - holder_count_ < late_count_ ? &late[holder - holder_count_]
                                                                   : nullptr;
  }
  void add_counts(Slab& slab) const;
  [[nodiscard]] std::unique_ptr<google::protobuf::Message> make_message() const;
  void poison(Envelope& envelope) noexcept;
  void revive(Envelope& envelope);
  void prepare_following() const noexcept;
  std::size_t free_all(Envelope* list) noexcept;
  void forget(std::size_t count) noexcept;

  // Constant after construction.
  const google::protobuf::Message* const default_instance_;
  const std::size_t trail_count_;  ///< Of each envelope.
  const Poison poison_;
  // Constant once anything is published.
  std::size_t holder_count_ = 0;
  std::size_t late_count_ = 0;
  std::unique_ptr<Kept[]> kept_;  ///< By holder.
  /// Those of the late holders, which most topics never have.
  std::atomic<Kept*> late_kept_{nullptr};

  // Owner only.
  std::vector<Slab> slabs_;  ///< All envelopes, as long as the pool exists.
  const google::protobuf::Message* prototype_ =
      nullptr;                     ///< Of poisoned messages that are revived.
  std::vector<void*> quarantine_;  ///< Their memory, the last ones.
  /// A list of lists: envelopes that were returned together stay together. The first of each points
  /// to the next list.
  Envelope* free_ = nullptr;
  bool is_collected_by_hand_ = false;
  std::atomic<std::size_t> size_{0};
  std::atomic<bool> is_overdrawn_{false};  ///< Set once, by any thread.

  alignas(64) std::atomic<Envelope*> returned_{nullptr};
  const Poison
      poison_of_returned_;  ///< As `poison_`: a thread that returns a message has this line anyway.
  ReturnSink* sink_ = nullptr;  ///< Constant once anything is taken.
  // After `close`: how many envelopes are not returned yet, plus one while the owner counts.
  std::atomic<std::size_t> outstanding_{1};
};

}  // namespace fastcycle::detail

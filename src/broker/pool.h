#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "broker/trail.h"
#include "fastcycle/detail/envelope.h"

namespace fastcycle::detail {

/// The messages that one publisher lends.
///
/// Readers on any thread push what they let go of on a stack; the owner takes the whole stack at
/// once. Since nobody takes single entries from it, an entry that comes back early can confuse
/// nothing (no ABA). The owner's free list is last-in first-out: the warmest message goes out
/// first.
///
/// A pool outlives its publisher until its last message came back.
///
/// @threads  `give_back` is Safe; all else is confined to the publisher.
/// @realtime `take` and `give_back` allocate nothing and take no lock. `grow` allocates.
class Pool {
 public:
  /// A pool whose envelopes own messages like `default_instance`; none for envelopes that only
  /// forward. Each has `trails` trails.
  explicit Pool(const google::protobuf::Message* default_instance, std::size_t trails = 0);

  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  /// Adds `count` envelopes; their messages are copies of `prototype`, cleared but with its
  /// capacity, so that a first publish of that size faults no page.
  void grow(std::size_t count, const google::protobuf::Message* prototype = nullptr);

  /// A free envelope, or null if all are out.
  [[nodiscard]] Envelope* take() noexcept;

  /// From now on `take` gives only what the last `collect` found: in simulated time, what comes
  /// back while a round runs must not decide how many messages there are.
  void collect_by_hand() noexcept { is_collected_by_hand_ = true; }
  /// Takes over what came back.
  void collect() noexcept;

  /// Takes back what the owner did not publish after all.
  void put_back(Envelope* envelope) noexcept;

  /// Takes back an envelope to which nobody holds a reference any more.
  void give_back(Envelope* envelope) noexcept;

  /// Ends the owner's part: messages that are free are freed, those that are out when they come
  /// back, and the last one frees the pool.
  void close() noexcept;

  /// All envelopes ever made.
  [[nodiscard]] std::size_t size() const noexcept { return size_.load(std::memory_order_relaxed); }

 private:
  ~Pool() = default;

  void prepare_following() const noexcept;
  std::size_t free_all(Envelope* list) noexcept;
  void forget(std::size_t count) noexcept;

  // Constant after construction.
  const google::protobuf::Message* const default_instance_;
  const std::size_t trail_count_;  ///< Of each envelope.

  // Owner only.
  std::vector<std::unique_ptr<Envelope[]>> slabs_;  ///< All envelopes, as long as the pool lives.
  std::vector<std::unique_ptr<Trail[]>> trails_;    ///< Those of the envelopes, slab by slab.
  /// A list of lists: what came back together stays together. Its first envelope knows the next.
  Envelope* free_ = nullptr;
  bool is_collected_by_hand_ = false;
  std::atomic<std::size_t> size_{0};

  alignas(64) std::atomic<Envelope*> returned_{nullptr};
  // After `close`: how many envelopes are still out, plus one while the owner counts.
  std::atomic<std::size_t> outstanding_{1};
};

}  // namespace fastcycle::detail

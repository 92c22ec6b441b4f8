#pragma once

#include <atomic>
#include <cstdint>

#include "fastcycle/message.h"

namespace fastcycle::detail {

class Pool;
class Trail;

/// A subscription, by its index within its topic: one that may keep a message beyond its callback.
using Holder = std::uint16_t;
/// No holder: its samples are not counted.
inline constexpr Holder kNobody = 0xffff;

/// What travels through the lanes: a counted handle to one published message, with its info.
///
/// It is recycled together with its message. A forwarded message travels in an envelope of the
/// forwarder, whose `foreign` is the envelope that owns the payload.
///
/// Invariant: while `references > 0`, `info` and `payload` do not change.
///
/// @threads  `references` is Safe; all else is written by the publisher before the first push.
struct alignas(64) Envelope {
  MessageInfo info;
  const google::protobuf::Message* payload = nullptr;
  std::atomic<std::uint32_t> references{0};
  bool is_scratch = false;  ///< Lent when the pool was empty: its publish is a counted drop.
  bool is_forwarded_again = false;  ///< The received message was itself forwarded.
  Holder foreign_holder = kNobody;  ///< The holder that keeps `foreign`.

  google::protobuf::Message* own = nullptr;  ///< The message allocated for this envelope, or null.
  Envelope* foreign = nullptr;               ///< The owner of the payload, when forwarded.
  Envelope* next = nullptr;                  ///< In the pool's lists.
  Envelope* next_list = nullptr;  ///< Set in the first of the pool's free list; see there.
  Pool* pool = nullptr;
  Trail* trails = nullptr;  ///< One for each root of latency chains; null if there are none.
  /// Number of samples that each holder keeps, by holder; null if holders are not counted.
  std::atomic<std::uint32_t>* kept_samples = nullptr;
  void* remains = nullptr;  ///< The memory of a released message that was poisoned; see `Pool`.
};

/// Takes one more reference; the caller must hold one already.
inline void retain(Envelope& envelope) noexcept {
  envelope.references.fetch_add(1, std::memory_order_relaxed);
}

/// Counts one more sample of the message that `holder` keeps beyond its callback. Before or after
/// `retain`; the reference is the caller's. Safe.
void keep(Envelope& envelope, Holder holder) noexcept;
/// Counts one less; before its reference is released. Safe.
void let_go(Envelope& envelope, Holder holder) noexcept;

/// Returns the envelope, which has no references left, to its pool.
void recycle(Envelope* envelope) noexcept;

/// Releases one reference; the last one returns the message to its pool.
inline void release(Envelope* envelope) noexcept {
  // The holder of the only reference needs no atomic step: no other thread can add one.
  if (envelope->references.load(std::memory_order_acquire) == 1) {
    envelope->references.store(0, std::memory_order_relaxed);
    recycle(envelope);
  } else if (envelope->references.fetch_sub(1, std::memory_order_acq_rel) == 1) {
    recycle(envelope);
  }
}

}  // namespace fastcycle::detail

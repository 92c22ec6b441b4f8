#pragma once

#include <atomic>
#include <cstdint>

#include "fastcycle/message.h"

namespace fastcycle::detail {

class Pool;
class Trail;

/// One subscription of a topic, by its place among them: who keeps a message beyond its callback.
using Holder = std::uint16_t;
/// Whose samples are not counted.
inline constexpr Holder kNobody = 0xffff;

/// What travels through the lanes: a counted handle to one published message, with its info.
///
/// It is recycled together with the message that it was made for. A forwarded message travels in an
/// envelope of the forwarder, whose `foreign` is the envelope that owns the payload.
///
/// Invariant: while `references > 0`, `info` and `payload` do not change.
///
/// @threads  `references` is Safe; all else is written by the publisher before the first push.
struct alignas(64) Envelope {
  MessageInfo info;
  const google::protobuf::Message* payload = nullptr;
  std::atomic<std::uint32_t> references{0};
  bool is_scratch = false;          ///< Lent when the pool was dry: its publish is a counted drop.
  bool is_forwarded_again = false;  ///< What was received was forwarded itself.
  Holder foreign_holder = kNobody;  ///< For whom `foreign` is kept.

  google::protobuf::Message* own = nullptr;  ///< The message made for this envelope, or none.
  Envelope* foreign = nullptr;               ///< Whose payload this is, when forwarded.
  Envelope* next = nullptr;                  ///< In the pool's lists.
  Envelope* next_list = nullptr;             ///< Of the first in the pool's free list; see there.
  Pool* pool = nullptr;
  Trail* trails = nullptr;  ///< One for each root of latency chains; null where there are none.
  /// Samples that each holder keeps, by holder; null where nobody is told apart.
  std::atomic<std::uint32_t>* kept_samples = nullptr;
  void* remains = nullptr;  ///< The memory of a released message that was poisoned; see `Pool`.
};

/// Takes one more reference; the caller must hold one already.
inline void retain(Envelope& envelope) noexcept {
  envelope.references.fetch_add(1, std::memory_order_relaxed);
}

/// Notes that `holder` keeps one sample of the message more beyond its callback. Before or after
/// `retain`; the reference is the caller's. Safe.
void keep(Envelope& envelope, Holder holder) noexcept;
/// Notes that it keeps one less; before its reference is released. Safe.
void let_go(Envelope& envelope, Holder holder) noexcept;

/// Gives the envelope, to which no reference is left, back to its pool.
void recycle(Envelope* envelope) noexcept;

/// Lets go of one reference; the last one gives the message back to its pool.
inline void release(Envelope* envelope) noexcept {
  // Who holds the only reference needs no atomic step: nobody else can add one.
  if (envelope->references.load(std::memory_order_acquire) == 1) {
    envelope->references.store(0, std::memory_order_relaxed);
    recycle(envelope);
  } else if (envelope->references.fetch_sub(1, std::memory_order_acq_rel) == 1) {
    recycle(envelope);
  }
}

}  // namespace fastcycle::detail

#pragma once

#include "base/priority_mutex.h"
#include "fastcycle/detail/envelope.h"

namespace fastcycle::detail {

class Subscription;

/// Who decides what becomes of the messages of one publisher before they are put into lanes: they
/// are put in, later, twice, others in their place, or not at all.
///
/// A publisher without one puts each message into all of its lanes.
///
/// @threads  Called by who publishes, with `mutex` held. Whoever puts something in at another time
///           (`PublisherCore::put_behind_gate`) holds it too.
class LaneGate {
 public:
  LaneGate() = default;
  LaneGate(const LaneGate&) = delete;
  LaneGate& operator=(const LaneGate&) = delete;
  virtual ~LaneGate() = default;

  /// `message`, which is numbered, is about to be put into the lanes.
  virtual void begin(Envelope& message) noexcept = 0;
  /// It is for `subscription`; what it is to have is put in by `PublisherCore::put_behind_gate`.
  virtual void pass(Envelope& message, Subscription& subscription) noexcept = 0;
  /// That was asked for all subscriptions.
  virtual void end(Envelope& message) noexcept = 0;

  base::PriorityMutex mutex;
};

}  // namespace fastcycle::detail

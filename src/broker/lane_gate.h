#pragma once

#include "base/priority_mutex.h"
#include "fastcycle/detail/envelope.h"

namespace fastcycle::detail {

class Subscription;

/// Filter between one publisher and its lanes: a message may pass, be delayed, duplicated, replaced
/// or dropped.
///
/// A publisher without one puts each message into all of its lanes.
///
/// @threads  Called by the publisher, with `mutex` held. Calls of `PublisherCore::put_behind_gate`
///           at other times hold it too.
class LaneGate {
 public:
  LaneGate() = default;
  LaneGate(const LaneGate&) = delete;
  LaneGate& operator=(const LaneGate&) = delete;
  virtual ~LaneGate() = default;

  /// `message`, which is numbered, is about to be put into the lanes.
  virtual void begin(Envelope& message) noexcept = 0;
  /// It is for `subscription`; the gate delivers by `PublisherCore::put_behind_gate`.
  virtual void pass(Envelope& message, Subscription& subscription) noexcept = 0;
  /// `pass` was called for all subscriptions.
  virtual void end(Envelope& message) noexcept = 0;

  base::PriorityMutex mutex;
};

}  // namespace fastcycle::detail

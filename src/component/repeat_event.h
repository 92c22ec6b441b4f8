#pragma once

#include <cstdint>
#include <span>

#include "broker/read_ring.h"
#include "executor/activation_ring.h"

namespace fastcycle::detail {

class ComponentCore;

/// Executes an activation by cause event again: of the watch in `reads`, or else of the timer
/// `key`. As `Actor::repeat`.
void repeat_event(ComponentCore& core, ActivationRing& ring,
                  std::span<const ReplayedReads::Entry> reads, std::uint64_t key,
                  std::int64_t time_ns, std::uint64_t skipped);

}  // namespace fastcycle::detail

#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "base/clock.h"
#include "base/histogram.h"
#include "broker/inbox.h"
#include "broker/publishing_component.h"

namespace fastcycle::detail {

/// Statistics of one component, written by the worker that serves it.
struct ActorStatistics {
  Counter activations;
  Counter faults;
  Counter overruns;          ///< Ticks skipped, over all timers.
  base::Histogram callback;  ///< Time in all callbacks, ns by CLOCK_MONOTONIC.
  base::Histogram lateness;  ///< From a tick's due time to its callback, ns.
};

/// The part of an actor that its parts and its observers use: its identity, inbox, publishing state
/// and statistics.
struct ActorBase {
  ActorBase(std::string its_name, std::uint32_t its_index, const base::Clock& its_clock)
      : name(std::move(its_name)), index(its_index), clock(its_clock) {
    publishing.name = name;
    publishing.clock = &clock;
  }
  ActorBase(const ActorBase&) = delete;
  ActorBase& operator=(const ActorBase&) = delete;

  // Constant once the application is built.
  const std::string name;
  const std::uint32_t index;
  const base::Clock& clock;

  Inbox inbox;
  PublishingComponent publishing;
  ActorStatistics statistics;

  /// Records the reads of its activations in `reads`. Before the start.
  void keep_reads(std::unique_ptr<ReadRing> reads) {
    reads_ = std::move(reads);
    publishing.reads = reads_.get();
  }

 protected:
  ~ActorBase() = default;

 private:
  std::unique_ptr<ReadRing> reads_;
};

}  // namespace fastcycle::detail

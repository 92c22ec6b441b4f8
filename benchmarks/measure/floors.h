#pragma once

#include <atomic>
#include <cstdint>

#include "measure/samples.h"
#include "measure/usage.h"

namespace fastcycle::measure {

/// One point to measure.
struct Plan {
  std::int64_t size = 32 * 1024;  ///< Payload, bytes.
  std::int64_t count = 5000;      ///< Messages, without the warm-up.
  std::int64_t warmup = 200;
  std::int64_t interval_us = 1000;
  bool is_fifo = false;                     ///< Threads run as SCHED_FIFO, where granted.
  std::int64_t slice_us = 0;                ///< The kernel's time slice of receivers; 0: as usual.
  const std::atomic<bool>* stop = nullptr;  ///< Ends the measurement early once it is true.
};

/// The SCHED_FIFO priority of the floors' threads and of FastCycle's workers.
inline constexpr int kFifoPriority = 80;

/// Whether this process may run threads as SCHED_FIFO with that priority.
[[nodiscard]] bool may_use_fifo();

/// The result of a floor: stamps, including the warm-up, and resource usage after the warm-up.
struct Measured {
  Samples samples;
  Usage usage;
};

enum class Waiting : std::uint8_t { kFutex, kSpin };

/// The minimum cost of a hand-over between two threads on this machine: a sender that fills a
/// recycled payload every interval and stores its address in a ring, and a receiver that sleeps on
/// a futex, or spins, until it arrives. No counters, no statistics, no options.
[[nodiscard]] Measured floor_latency(const Plan& plan, Waiting waiting);

/// The same between two processes, which share ring and payloads. The usage is that of the sender's
/// process.
///
/// @errors  std::system_error if no process can be created.
[[nodiscard]] Measured floor_processes(const Plan& plan, Waiting waiting);

/// The round trip: the second thread answers with the same payload. `arrived_ns` is when the answer
/// arrives.
[[nodiscard]] Measured floor_rtt(const Plan& plan, Waiting waiting);

/// The minimum lateness of a timer: a loop of clock_nanosleep to absolute times. `sent_ns` is when
/// a tick was due, `arrived_ns` when the thread ran.
[[nodiscard]] Measured floor_timer(const Plan& plan);

}  // namespace fastcycle::measure

#pragma once

#include "bench/session.h"

namespace fastcycle::tool::bench {

// Each mode is in its own file. Without a session only its application can be queried.
[[nodiscard]] Mode latency_mode(const Options& options, Session* session);  ///< And rtt.
[[nodiscard]] Mode flood_mode(const Options& options, Session* session);
[[nodiscard]] Mode fanout_mode(const Options& options, Session* session);
[[nodiscard]] Mode timer_mode(const Options& options, Session* session);
[[nodiscard]] Mode deadline_mode(const Options& options, Session* session);
[[nodiscard]] Mode chain_mode(const Options& options, Session* session);
[[nodiscard]] Mode startup_mode(const Options& options, Session* session);
[[nodiscard]] Mode record_mode(const Options& options, Session* session);
[[nodiscard]] Mode disk_mode(const Options& options, Session* session);
[[nodiscard]] Mode inspect_mode(const Options& options, Session* session);
[[nodiscard]] Mode trace_mode(const Options& options, Session* session);

/// The lateness of a bare sleep to absolute times: the floor for timers, and so for deadlines.
[[nodiscard]] Finding measure_timer_floor(const Session& session);

}  // namespace fastcycle::tool::bench

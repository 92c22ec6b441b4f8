#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "measure/samples.h"
#include "measure/statistics.h"
#include "measure/usage.h"

namespace fastcycle::measure {

/// One measured point: a peer, a mode, a size, a round. As JSON it is one object on one line,
/// without the fields that the mode does not measure.
struct Row {
  std::string peer;  ///< "fastcycle-park", "floor-futex", "zeromq-inproc", …
  std::string mode;  ///< latency, rtt, flood, fanout, timer, chain, startup
  std::int64_t size = 0;
  std::int64_t round = 1;
  std::int64_t n = 0;     ///< Messages measured, without the warm-up.
  std::int64_t lost = 0;  ///< Sent after the warm-up, and never received.
  std::int64_t warmup = 0;
  std::int64_t interval_us = 0;
  std::optional<Statistics> time = {};        ///< The main result of the mode.
  std::optional<Statistics> end_to_end = {};  ///< Including the time to fill the payload.
  std::optional<double> interval_std_us =
      {};                      ///< Standard deviation of receive minus send interval.
  std::string histogram = {};  ///< Of `time`, a JSON object; empty: none.
  std::optional<double> cpu_us_per_msg = {};
  std::optional<Usage> usage = {};  ///< Over the measured messages.
  // Flood.
  std::optional<std::int64_t> sent = {};
  std::optional<std::int64_t> received = {};
  std::optional<double> rate_per_s = {};
  /// Further keys of a mode: ready JSON without braces, such as `"subscribers":4`.
  std::string more = {};
};

[[nodiscard]] std::string to_json(const Row& row);

/// Computes the fields of a row of mode "latency" or "rtt" from `samples`, of which `sent` messages
/// were published after the warm-up, and from the process's usage in that time.
void measure_into(Row& row, const Samples& samples, std::int64_t sent, const Usage& usage);

}  // namespace fastcycle::measure

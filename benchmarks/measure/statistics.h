#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace fastcycle::measure {

/// Published statistics of a series of durations, in microseconds; no outliers are removed.
struct Statistics {
  std::size_t count = 0;
  double mean_us = 0;
  double std_us = 0;  ///< Of the population: divided by n.
  double min_us = 0;
  double p50_us = 0;
  double p90_us = 0;
  double p99_us = 0;
  double p999_us = 0;
  double max_us = 0;
};

/// Exact statistics of `durations_ns`; a percentile is the smallest value that at least that share
/// of the values does not exceed (nearest rank). All zero without values.
[[nodiscard]] Statistics summarize(std::vector<std::int64_t> durations_ns);

/// Counts of durations in buckets that grow by 2^(1/4), as "us:count" pairs of the upper bounds, as
/// a JSON object. Empty buckets are left out.
[[nodiscard]] std::string histogram_json(const std::vector<std::int64_t>& durations_ns);

}  // namespace fastcycle::measure

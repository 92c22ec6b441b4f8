#include "measure/statistics.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

namespace fastcycle::measure {
namespace {

constexpr double kNsPerUs = 1000.0;

double percentile_us(const std::vector<std::int64_t>& sorted_ns, double share) {
  const double rank = std::ceil(share * static_cast<double>(sorted_ns.size()));
  const auto index = static_cast<std::size_t>(std::max(rank, 1.0)) - 1;
  return static_cast<double>(sorted_ns[index]) / kNsPerUs;
}

}  // namespace

Statistics summarize(std::vector<std::int64_t> durations_ns) {
  Statistics result;
  result.count = durations_ns.size();
  if (durations_ns.empty()) {
    return result;
  }
  std::sort(durations_ns.begin(), durations_ns.end());
  const auto count = static_cast<double>(durations_ns.size());
  double sum = 0;
  for (const std::int64_t value : durations_ns) {
    sum += static_cast<double>(value);
  }
  const double mean = sum / count;
  double squares = 0;
  for (const std::int64_t value : durations_ns) {
    const double difference = static_cast<double>(value) - mean;
    squares += difference * difference;
  }
  result.mean_us = mean / kNsPerUs;
  result.std_us = std::sqrt(squares / count) / kNsPerUs;
  result.min_us = static_cast<double>(durations_ns.front()) / kNsPerUs;
  result.p50_us = percentile_us(durations_ns, 0.5);
  result.p90_us = percentile_us(durations_ns, 0.9);
  result.p99_us = percentile_us(durations_ns, 0.99);
  result.p999_us = percentile_us(durations_ns, 0.999);
  result.max_us = static_cast<double>(durations_ns.back()) / kNsPerUs;
  return result;
}

std::string histogram_json(const std::vector<std::int64_t>& durations_ns) {
  constexpr double kBucketsPerOctave = 4;
  constexpr double kSmallestUs = 0.125;  // 2^-3: shorter ones are counted in the first bucket.
  std::map<int, std::size_t> counts;
  for (const std::int64_t value : durations_ns) {
    const double us = std::max(static_cast<double>(value) / kNsPerUs, kSmallestUs);
    ++counts[static_cast<int>(std::ceil(std::log2(us) * kBucketsPerOctave))];
  }
  std::string text;
  for (const auto& [bucket, count] : counts) {
    text += fmt::format("{}\"{:.3f}\":{}", text.empty() ? "" : ",",
                        std::exp2(bucket / kBucketsPerOctave), count);
  }
  return "{" + text + "}";
}

}  // namespace fastcycle::measure

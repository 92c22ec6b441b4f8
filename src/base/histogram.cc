#include "base/histogram.h"

#include <algorithm>
#include <cmath>

namespace fastcycle::base {
void Histogram::merge(const Histogram& other) noexcept {
  constexpr auto kRelaxed = std::memory_order_relaxed;
  for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
    const std::uint64_t count = count_of(bucket) + other.count_of(bucket);
    counts_[bucket].store(static_cast<std::uint32_t>(count), kRelaxed);
    carries_[bucket].store(static_cast<std::uint16_t>(count >> 32U), kRelaxed);
  }
  add(sum_, other.sum_.load(kRelaxed));
  add(square_sum_, other.square_sum_.load(kRelaxed));
  max_.store(std::max(max_.load(kRelaxed), other.max_.load(kRelaxed)), kRelaxed);
}

std::uint64_t Histogram::count() const noexcept {
  std::uint64_t sum = 0;
  for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
    sum += count_of(bucket);
  }
  return sum;
}

double Histogram::middle_of(std::size_t bucket) noexcept {
  constexpr double kStep = 1U << kStepBits;
  if (bucket < (1U << kSubBits)) {
    return (static_cast<double>(bucket) + 0.5) * kStep;
  }
  const unsigned octave = static_cast<unsigned>(bucket >> kSubBits);
  const auto sub = static_cast<double>(bucket & ((1U << kSubBits) - 1));
  return std::ldexp((1 << kSubBits) + sub + 0.5, static_cast<int>(octave) - 1) * kStep;
}

double Histogram::percentile(double share, std::uint64_t count) const noexcept {
  const auto rank = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count)));
  std::uint64_t seen = 0;
  for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
    seen += count_of(bucket);
    if (seen >= rank) {
      return std::min(middle_of(bucket), static_cast<double>(max_.load(std::memory_order_relaxed)));
    }
  }
  return static_cast<double>(max_.load(std::memory_order_relaxed));
}

HistogramSummary Histogram::summary() const noexcept {
  HistogramSummary summary;
  summary.count = count();
  if (summary.count == 0) {
    return summary;
  }
  const auto n = static_cast<double>(summary.count);
  summary.mean = sum_.load(std::memory_order_relaxed) / n;
  const double variance =
      square_sum_.load(std::memory_order_relaxed) / n - summary.mean * summary.mean;
  summary.standard_deviation = std::sqrt(std::max(variance, 0.0));
  summary.p50 = percentile(0.5, summary.count);
  summary.p99 = percentile(0.99, summary.count);
  summary.p999 = percentile(0.999, summary.count);
  summary.max = static_cast<double>(max_.load(std::memory_order_relaxed));
  return summary;
}

}  // namespace fastcycle::base

#include "base/histogram.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace fastcycle::base {
namespace {

template <typename T>
void add(std::atomic<T>& counter, T amount) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + amount, std::memory_order_relaxed);
}

}  // namespace

std::size_t Histogram::bucket_of(std::uint64_t value) noexcept {
  if (value < (1U << kSubBits)) {
    return static_cast<std::size_t>(value);
  }
  const unsigned exponent = static_cast<unsigned>(std::bit_width(value)) - 1;
  const std::uint64_t sub = (value >> (exponent - kSubBits)) & ((1U << kSubBits) - 1);
  const std::size_t bucket = ((exponent - kSubBits + 1) << kSubBits) + sub;
  return std::min(bucket, kBuckets - 1);
}

double Histogram::middle_of(std::size_t bucket) noexcept {
  if (bucket < (1U << kSubBits)) {
    return static_cast<double>(bucket);
  }
  const unsigned octave = static_cast<unsigned>(bucket >> kSubBits);
  const auto sub = static_cast<double>(bucket & ((1U << kSubBits) - 1));
  return std::ldexp((1 << kSubBits) + sub + 0.5, static_cast<int>(octave) - 1);
}

void Histogram::record(std::int64_t nanoseconds) noexcept {
  const auto value = static_cast<std::uint64_t>(std::max<std::int64_t>(nanoseconds, 0));
  add(buckets_[bucket_of(value)], std::uint64_t{1});
  add(sum_, static_cast<double>(value));
  add(square_sum_, static_cast<double>(value) * static_cast<double>(value));
  if (value > max_.load(std::memory_order_relaxed)) {
    max_.store(value, std::memory_order_relaxed);
  }
  add(count_, std::uint64_t{1});
}

double Histogram::percentile(double share, std::uint64_t count) const noexcept {
  const auto rank = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count)));
  std::uint64_t seen = 0;
  for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
    seen += buckets_[bucket].load(std::memory_order_relaxed);
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

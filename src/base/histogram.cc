#include "base/histogram.h"

#include <algorithm>
#include <cmath>

namespace fastcycle::base {

template <unsigned kSubBits>
void LogHistogram<kSubBits>::merge(const LogHistogram& other) noexcept {
  constexpr auto kRelaxed = std::memory_order_relaxed;
  for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
    count(bucket, other.counts_[bucket].load(kRelaxed));
  }
  add(halved_, other.halved_.load(kRelaxed));
  add(sum_, other.sum_.load(kRelaxed));
  add(square_sum_, other.square_sum_.load(kRelaxed));
  max_.store(std::max(max_.load(kRelaxed), other.max_.load(kRelaxed)), kRelaxed);
}

template <unsigned kSubBits>
void LogHistogram<kSubBits>::halve() noexcept {
  for (auto& counter : counts_) {
    const std::uint32_t before = counter.load(std::memory_order_relaxed);
    counter.store(before / 2, std::memory_order_relaxed);
    add(halved_, std::uint64_t{before - before / 2});
  }
}

template <unsigned kSubBits>
std::uint64_t LogHistogram<kSubBits>::in_buckets() const noexcept {
  std::uint64_t sum = 0;
  for (const auto& counter : counts_) {
    sum += counter.load(std::memory_order_relaxed);
  }
  return sum;
}

template <unsigned kSubBits>
std::uint64_t LogHistogram<kSubBits>::count() const noexcept {
  return in_buckets() + halved_.load(std::memory_order_relaxed);
}

template <unsigned kSubBits>
double LogHistogram<kSubBits>::middle_of(std::size_t bucket) noexcept {
  constexpr double kStep = 1U << kStepBits;
  if (bucket < (1U << kSubBits)) {
    return (static_cast<double>(bucket) + 0.5) * kStep;
  }
  const unsigned octave = static_cast<unsigned>(bucket >> kSubBits);
  const auto sub = static_cast<double>(bucket & ((1U << kSubBits) - 1));
  return std::ldexp((1 << kSubBits) + sub + 0.5, static_cast<int>(octave) - 1) * kStep;
}

template <unsigned kSubBits>
double LogHistogram<kSubBits>::percentile(double share, std::uint64_t count) const noexcept {
  const auto rank = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count)));
  std::uint64_t seen = 0;
  for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
    seen += counts_[bucket].load(std::memory_order_relaxed);
    if (seen >= rank) {
      return std::min(middle_of(bucket), static_cast<double>(max_.load(std::memory_order_relaxed)));
    }
  }
  return static_cast<double>(max_.load(std::memory_order_relaxed));
}

template <unsigned kSubBits>
HistogramSummary LogHistogram<kSubBits>::summary() const noexcept {
  HistogramSummary summary;
  const std::uint64_t kept = in_buckets();
  summary.count = kept + halved_.load(std::memory_order_relaxed);
  if (summary.count == 0) {
    return summary;
  }
  const auto n = static_cast<double>(summary.count);
  summary.mean = sum_.load(std::memory_order_relaxed) / n;
  const double variance =
      square_sum_.load(std::memory_order_relaxed) / n - summary.mean * summary.mean;
  summary.standard_deviation = std::sqrt(std::max(variance, 0.0));
  summary.p50 = percentile(0.5, kept);
  summary.p99 = percentile(0.99, kept);
  summary.p999 = percentile(0.999, kept);
  summary.max = static_cast<double>(max_.load(std::memory_order_relaxed));
  return summary;
}

template <unsigned kSubBits>
HistogramBuckets LogHistogram<kSubBits>::buckets() const noexcept {
  constexpr auto kRelaxed = std::memory_order_relaxed;
  HistogramBuckets buckets;
  std::size_t next = 0;
  for (std::size_t i = 0; i < HistogramBuckets::kBounds; ++i) {
    for (const std::size_t end = bucket_of(HistogramBuckets::bound_ns(i)); next < end; ++next) {
      buckets.count += counts_[next].load(kRelaxed);
    }
    buckets.below[i] = buckets.count;
  }
  for (; next < kBuckets; ++next) {
    buckets.count += counts_[next].load(kRelaxed);
  }
  buckets.count += halved_.load(kRelaxed);
  buckets.sum_ns = sum_.load(kRelaxed);
  return buckets;
}

template class LogHistogram<4>;
template class LogHistogram<3>;

}  // namespace fastcycle::base

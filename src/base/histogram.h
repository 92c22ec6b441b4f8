#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

#ifndef FASTCYCLE_STATISTICS  // Defined by CMake if it is OFF.
#define FASTCYCLE_STATISTICS 1
#endif

namespace fastcycle::base {

/// Whether anything is recorded in histograms.
inline constexpr bool kHasStatistics = FASTCYCLE_STATISTICS != 0;

/// Summary of a histogram, in the unit of the recorded values.
struct HistogramSummary {
  std::uint64_t count = 0;
  double mean = 0;
  double standard_deviation = 0;
  double p50 = 0;
  double p99 = 0;
  double p999 = 0;
  double max = 0;
};

/// How many of the values were below each of some bounds: powers of two, from 1.024 µs to 2.15 s.
struct HistogramBuckets {
  static constexpr unsigned kFirstBits = 10;
  static constexpr std::size_t kBounds = 22;
  /// The bound of `below[i]`, in nanoseconds.
  static constexpr std::uint64_t bound_ns(std::size_t i) {
    return std::uint64_t{1} << (kFirstBits + i);
  }

  std::array<std::uint64_t, kBounds> below{};
  std::uint64_t count = 0;  ///< All of them,
  double sum_ns = 0;        ///< and their sum.
};

/// Durations in nanoseconds, in buckets that grow with the value: each at most 1/2^kSubBits of its
/// value wide, or 4 ns, from 0 to 4.3 s; longer ones count in the last bucket. Count, mean,
/// deviation and maximum are exact. A bucket counts to 2^32; when one is full all are halved, so
/// that older values have half the weight in percentiles: after more than an hour at a million a
/// second.
///
/// @threads  `record` by one thread at a time; `summary` and `buckets` by any thread, and exact
/// when
///           nothing is being recorded.
/// @realtime No lock, no allocation; a handful of additions. Where FASTCYCLE_STATISTICS is OFF,
///           nothing at all.
template <unsigned kSubBits>
class LogHistogram {
 public:
  /// Counts `nanoseconds` `times` times; negative values count as 0.
  void record(std::int64_t nanoseconds, std::uint32_t times = 1) noexcept {
    if constexpr (kHasStatistics) {
      const auto value = static_cast<std::uint64_t>(nanoseconds > 0 ? nanoseconds : 0);
      const double real = static_cast<double>(value) * times;
      count(bucket_of(value), times);
      add(sum_, real);
      add(square_sum_, real * static_cast<double>(value));
      if (value > max_.load(std::memory_order_relaxed)) {
        max_.store(value, std::memory_order_relaxed);
      }
    }
  }

  /// Adds the counts of `other`; as `record`.
  void merge(const LogHistogram& other) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept;
  [[nodiscard]] HistogramSummary summary() const noexcept;
  [[nodiscard]] HistogramBuckets buckets() const noexcept;

 private:
  static constexpr unsigned kStepBits = 2;  ///< Resolution: 4 ns.
  static constexpr unsigned kOctaves = 31 - kSubBits;
  static constexpr std::size_t kBuckets = (kOctaves << kSubBits);

  template <typename T>
  static void add(std::atomic<T>& counter, T amount) noexcept {
    counter.store(static_cast<T>(counter.load(std::memory_order_relaxed) + amount),
                  std::memory_order_relaxed);
  }
  [[nodiscard]] static std::size_t bucket_of(std::uint64_t value) noexcept {
    const std::uint64_t steps = value >> kStepBits;
    if (steps < (1U << kSubBits)) {
      return static_cast<std::size_t>(steps);
    }
    const unsigned exponent = static_cast<unsigned>(std::bit_width(steps)) - 1;
    const std::uint64_t sub = (steps >> (exponent - kSubBits)) & ((1U << kSubBits) - 1);
    const std::size_t bucket = ((exponent - kSubBits + 1) << kSubBits) + sub;
    return bucket < kBuckets ? bucket : kBuckets - 1;
  }
  void count(std::size_t bucket, std::uint32_t times) noexcept {
    while (counts_[bucket].load(std::memory_order_relaxed) > UINT32_MAX - times) {
      halve();
    }
    add(counts_[bucket], times);
  }
  void halve() noexcept;
  [[nodiscard]] std::uint64_t in_buckets() const noexcept;
  [[nodiscard]] static double middle_of(std::size_t bucket) noexcept;
  [[nodiscard]] double percentile(double share, std::uint64_t count) const noexcept;

  // One writer: plain additions, as relaxed loads and stores so that readers may read concurrently.
  std::array<std::atomic<std::uint32_t>, kBuckets> counts_{};
  std::atomic<std::uint64_t> halved_{0};  ///< Counts removed from buckets by halving.
  std::atomic<double> sum_{0};
  std::atomic<double> square_sum_{0};
  std::atomic<std::uint64_t> max_{0};
};

/// In 1.8 KB: one for a component.
using Histogram = LogHistogram<4>;
/// In 0.9 KB: one for each subscription and each callback.
using CoarseHistogram = LogHistogram<3>;

extern template class LogHistogram<4>;
extern template class LogHistogram<3>;

}  // namespace fastcycle::base

#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace fastcycle::base {

/// Summary of a histogram, in the unit of what was recorded.
struct HistogramSummary {
  std::uint64_t count = 0;
  double mean = 0;
  double standard_deviation = 0;
  double p50 = 0;
  double p99 = 0;
  double p999 = 0;
  double max = 0;
};

/// Durations in nanoseconds, in buckets that grow with the value: each at most 1/16 of its value
/// wide, or 4 ns, from 0 to 4.3 s; what is longer counts in the last one. Mean, deviation and
/// maximum are exact. A bucket counts to 2^48, in 6 bytes: there is one histogram for each
/// subscription, and most of its memory are the buckets.
///
/// @threads  `record` by one thread at a time; `summary` by any thread, and exact when nothing is
///           being recorded.
/// @realtime No lock, no allocation; a handful of additions.
class Histogram {
 public:
  /// Counts `nanoseconds`, as often as `times` says; what is negative counts as 0.
  void record(std::int64_t nanoseconds, std::uint32_t times = 1) noexcept {
    const auto value = static_cast<std::uint64_t>(nanoseconds > 0 ? nanoseconds : 0);
    const double real = static_cast<double>(value) * times;
    const std::size_t bucket = bucket_of(value);
    add(counts_[bucket], times);
    if (counts_[bucket].load(std::memory_order_relaxed) < times) {
      add(carries_[bucket], std::uint16_t{1});
    }
    add(sum_, real);
    add(square_sum_, real * static_cast<double>(value));
    if (value > max_.load(std::memory_order_relaxed)) {
      max_.store(value, std::memory_order_relaxed);
    }
  }

  /// Adds what `other` counted; as `record`.
  void merge(const Histogram& other) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept;
  [[nodiscard]] HistogramSummary summary() const noexcept;

 private:
  static constexpr unsigned kStepBits = 2;  ///< What is shorter than 4 ns is not told apart.
  static constexpr unsigned kSubBits = 4;
  static constexpr unsigned kOctaves = 27;
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
  [[nodiscard]] std::uint64_t count_of(std::size_t bucket) const noexcept {
    return (std::uint64_t{carries_[bucket].load(std::memory_order_relaxed)} << 32U) |
           counts_[bucket].load(std::memory_order_relaxed);
  }
  [[nodiscard]] static double middle_of(std::size_t bucket) noexcept;
  [[nodiscard]] double percentile(double share, std::uint64_t count) const noexcept;

  // One writer: plain additions, as relaxed loads and stores so that a reader may look.
  std::array<std::atomic<std::uint32_t>, kBuckets> counts_{};
  std::array<std::atomic<std::uint16_t>, kBuckets> carries_{};  ///< Of 2^32 each.
  std::atomic<double> sum_{0};
  std::atomic<double> square_sum_{0};
  std::atomic<std::uint64_t> max_{0};
};

}  // namespace fastcycle::base

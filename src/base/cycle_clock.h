#pragma once

#include <algorithm>
#include <cstdint>

namespace fastcycle::base {

/// The time of a system clock, mostly from the CPU's cycle counter, which is read in a fraction of
/// the time: the system clock is read again when `kSpan_ns` have passed since it was last. In
/// between the error is that of the counter's rate, which is measured anew every `kBaseline_ns`.
///
/// It never goes back. Where the counter shows no steady rate, or the thread reads too seldom to
/// measure it, every reading is one of the system clock.
///
/// `Source` has two static functions: `cycles()`, the counter, and `ns()`, the system clock.
///
/// @threads  Each has its own.
template <typename Source>
class CycleClock {
 public:
  /// How far the system clock may be slewed in it: 50 ns at the 500 ppm that NTP uses at most.
  static constexpr std::int64_t kSpan_ns = 100'000;
  /// A rate from two readings with an error of 50 ns each is right to 10 ppm: 1 ns in a span.
  static constexpr std::int64_t kBaseline_ns = 10'000'000;
  /// A longer time may contain a suspension of the machine.
  static constexpr std::int64_t kBaselineMax_ns = 1'000'000'000;
  /// Two baselines in a row have to agree to one part in this many.
  static constexpr std::uint64_t kAgreement = 1000;
  /// A reading of the system clock that took more cycles was interrupted: it has no exact place
  /// between the counter's. About 0.3 µs.
  static constexpr std::uint64_t kReadCyclesMax = 1000;

  [[nodiscard]] std::int64_t now_ns() noexcept {
    const std::uint64_t cycles = Source::cycles();
    const std::uint64_t passed = cycles - cycles_;
    if (passed < span_cycles_) [[likely]] {
      return ns_ + to_ns(passed);
    }
    return synchronize(cycles);
  }

 private:
  [[nodiscard]] std::int64_t to_ns(std::uint64_t cycles) const noexcept {
    return static_cast<std::int64_t>((cycles * scale_) >> kScaleBits);
  }

  [[gnu::noinline]] std::int64_t synchronize(std::uint64_t before) noexcept {
    const std::int64_t read_ns = Source::ns();
    const std::uint64_t taken = Source::cycles() - before;
    const std::int64_t newest_ns = ns_ + to_ns(span_cycles_);  // Nothing later was returned.
    const std::int64_t ahead_ns = std::max<std::int64_t>(newest_ns - read_ns, 0);
    ns_ = read_ns + ahead_ns;
    if (taken > kReadCyclesMax) {
      span_cycles_ = 0;
      return ns_;
    }
    cycles_ = before + taken / 2;
    measure(read_ns);
    span_cycles_ = is_steady_ ? (static_cast<std::uint64_t>(kSpan_ns) << kScaleBits) / rate_ : 0;
    // What it is ahead it loses in the next span, instead of going back.
    scale_ =
        rate_ - rate_ / kSpan_ns * static_cast<std::uint64_t>(std::min(ahead_ns, kSpan_ns / 2));
    return ns_;
  }

  void measure(std::int64_t read_ns) noexcept {
    const std::int64_t elapsed_ns = read_ns - begin_ns_;
    if (begin_ns_ != 0 && elapsed_ns < kBaseline_ns) {
      return;
    }
    std::uint64_t rate = 0;
    if (begin_ns_ != 0 && elapsed_ns >= kBaseline_ns && elapsed_ns <= kBaselineMax_ns) {
      rate = (static_cast<std::uint64_t>(elapsed_ns) << kScaleBits) /
             std::max<std::uint64_t>(cycles_ - begin_cycles_, 1);
    }
    const std::uint64_t difference = rate > rate_ ? rate - rate_ : rate_ - rate;
    // The bounds keep what is computed of it within 64 bits.
    is_steady_ = rate >= kRateMin && rate <= kRateMax && difference < rate / kAgreement;
    rate_ = rate;
    begin_ns_ = read_ns;
    begin_cycles_ = cycles_;
  }

  static constexpr unsigned kScaleBits = 32;
  static constexpr std::uint64_t kRateMin = std::uint64_t{1} << (kScaleBits - 4);  // 16 GHz.
  static constexpr std::uint64_t kRateMax = std::uint64_t{1} << (kScaleBits + 4);  // 62 MHz.

  std::uint64_t cycles_ = 0;       ///< When the system clock was read last.
  std::uint64_t span_cycles_ = 0;  ///< For so long after it the counter is used; 0: not at all.
  std::uint64_t scale_ = 0;        ///< By which it goes in the span: `rate_`, or less.
  std::int64_t ns_ = 0;            ///< The time at `cycles_`.
  std::uint64_t begin_cycles_ = 0;
  std::int64_t begin_ns_ = 0;  ///< Of the baseline; 0: there is none yet.
  std::uint64_t rate_ = 0;     ///< Nanoseconds of a cycle, times 2^kScaleBits, as measured last.
  bool is_steady_ = false;     ///< The last two agreed.
};

}  // namespace fastcycle::base

#include "base/clock.h"

#include <ctime>
#include <fstream>
#include <string>

#if defined(__x86_64__)
#include <x86intrin.h>

#include "base/cycle_clock.h"
#endif

#include "fastcycle/assert.h"

namespace fastcycle::base {
namespace {

std::int64_t read_clock(clockid_t id) noexcept {
  timespec time{};
  clock_gettime(id, &time);
  return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
}

#if defined(__x86_64__)

struct CpuCounter {
  /// Not ordered with the loads around it: a few tens of nanoseconds of what is measured, for a
  /// third of the time.
  static std::uint64_t cycles() noexcept { return __rdtsc(); }
  static std::int64_t ns() noexcept { return read_clock(CLOCK_MONOTONIC); }
};

constinit thread_local CycleClock<CpuCounter> cycle_clock [[gnu::tls_model("initial-exec")]];

/// Whether the kernel itself takes the time from the counter. Then it has checked that the counter
/// runs at one rate, in idle states too, and agrees among the CPUs.
const bool counter_is_clock = [] {
  std::ifstream file("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  std::string name;
  return file >> name && name == "tsc";
}();

#endif

}  // namespace

std::int64_t monotonic_ns() noexcept {
#if defined(__x86_64__)
  if (counter_is_clock) {
    return cycle_clock.now_ns();
  }
#endif
  return read_clock(CLOCK_MONOTONIC);
}

Clock::Clock(bool is_simulated, double rate, std::int64_t origin_ns,
             std::int64_t monotonic_origin_ns)
    : is_simulated_(is_simulated),
      rate_(rate),
      origin_ns_(origin_ns),
      monotonic_origin_ns_(monotonic_origin_ns),
      simulated_ns_(origin_ns) {}

Clock::Clock(const Clock& other) noexcept
    : is_simulated_(other.is_simulated_),
      rate_(other.rate_),
      origin_ns_(other.origin_ns_),
      monotonic_origin_ns_(other.monotonic_origin_ns_.load()),
      simulated_ns_(other.simulated_ns_.load()) {}

Clock Clock::live(double rate) {
  FASTCYCLE_ASSERT(rate > 0, "a clock's rate is above zero");
  return {false, rate, read_clock(CLOCK_REALTIME), monotonic_ns()};
}

Clock Clock::simulated(Time start) {
  return {true, 1.0, to_ns(start), 0};
}

Time Clock::now() const noexcept {
  return at_monotonic(is_simulated_ ? 0 : monotonic_ns());
}

Time Clock::at_monotonic(std::int64_t monotonic) const noexcept {
  if (is_simulated_) {
    return from_ns(simulated_ns_.load(std::memory_order_acquire));
  }
  const std::int64_t origin = monotonic_origin_ns_.load(std::memory_order_relaxed);
  const std::int64_t elapsed = origin == kNever ? 0 : monotonic - origin;
  return from_ns(
      origin_ns_ +
      (rate_ == 1.0 ? elapsed : static_cast<std::int64_t>(static_cast<double>(elapsed) * rate_)));
}

std::int64_t Clock::monotonic_at(Time time) const noexcept {
  const std::int64_t ahead = to_ns(time) - origin_ns_;
  const std::int64_t origin = monotonic_origin_ns_.load(std::memory_order_relaxed);
  return (origin == kNever ? monotonic_ns() : origin) +
         (rate_ == 1.0 ? ahead : static_cast<std::int64_t>(static_cast<double>(ahead) / rate_) + 1);
}

void Clock::set_simulated(Time time) noexcept {
  FASTCYCLE_ASSERT(is_simulated_ && time >= now(), "simulated time only goes forward");
  simulated_ns_.store(to_ns(time), std::memory_order_release);
}

void Clock::restart(Time time) noexcept {
  origin_ns_ = to_ns(time);
  monotonic_origin_ns_ = is_simulated_ ? 0 : monotonic_ns();
  simulated_ns_.store(origin_ns_, std::memory_order_release);
}

void Clock::stand_at(Time time) noexcept {
  FASTCYCLE_ASSERT(!is_simulated_, "a simulated clock stands by itself");
  origin_ns_ = to_ns(time);
  monotonic_origin_ns_ = kNever;
}

bool Clock::stands() const noexcept {
  return monotonic_origin_ns_.load(std::memory_order_relaxed) == kNever;
}

void Clock::go_on_at(std::int64_t monotonic) noexcept {
  FASTCYCLE_ASSERT(stands(), "a clock that goes on did stand");
  monotonic_origin_ns_.store(monotonic, std::memory_order_relaxed);
}

}  // namespace fastcycle::base

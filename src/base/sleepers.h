#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace fastcycle::base {

/// The workers of one executor that sleep, and how one of them is woken (an eventcount).
///
/// A worker that found nothing to do announces that it will sleep, looks once more, and sleeps. Who
/// has work for it puts the work where workers look, and then asks for a sleeper to be woken:
///
///     worker:  announce(i); if (found work) withdraw(i); else sleep(i, deadline);
///     waker:   put work; wake_one();
///
/// Announcing and looking, putting and asking are sequentially consistent on both sides, so either
/// the worker sees the work or the waker sees the worker: no wake-up is lost, and no timed wait is
/// needed to hide one. The waker takes the sleeper off the set, so a burst makes one call.
///
/// @threads  Safe; each worker uses its own index.
/// @realtime `wake_one` is one load when nobody sleeps, else one system call.
class Sleepers {
 public:
  static constexpr unsigned kMaxWorkers = 64;

  /// Says that worker `index` is about to sleep. It must look for work once more after this.
  void announce(unsigned index) noexcept;

  /// Takes an announcement back. If a waker was faster, its wake-up is consumed.
  void withdraw(unsigned index) noexcept;

  /// Sleeps until woken, or until CLOCK_MONOTONIC shows `deadline_ns` (`kNever`: no limit).
  /// Returns true if it was woken.
  bool sleep(unsigned index, std::int64_t deadline_ns) noexcept;

  /// Wakes one sleeper, if there is one: the one that leads only if there is no other.
  bool wake_one() noexcept;

  /// Brings near what `wake_one` will write.
  void prepare_wake() const noexcept {
    __builtin_prefetch(&sleeping_, 1);
    __builtin_prefetch(&slots_[0], 1);
  }

  /// Wakes worker `index` if it sleeps.
  bool wake(unsigned index) noexcept;

  /// Names the worker that watches the timers, which is woken last; `kMaxWorkers` for none.
  void set_leader(unsigned index) noexcept { leader_.store(index, std::memory_order_relaxed); }

  [[nodiscard]] bool has_sleepers() const noexcept {
    return sleeping_.load(std::memory_order_seq_cst) != 0;
  }

 private:
  struct alignas(64) Slot {
    std::atomic<std::uint32_t> is_woken{0};
  };

  bool take_off(unsigned index) noexcept;
  void consume(unsigned index) noexcept;

  alignas(64) std::atomic<std::uint64_t> sleeping_{0};
  std::atomic<unsigned> leader_{kMaxWorkers};
  std::array<Slot, kMaxWorkers> slots_;
};

}  // namespace fastcycle::base

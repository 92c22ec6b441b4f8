#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

namespace fastcycle::base {

/// A word in memory that other processes write too, and what it showed: a sleeper returns when it
/// shows something else and who changed it wakes it.
struct WatchedWord {
  const std::atomic<std::uint32_t>* word;
  std::uint32_t seen;
};

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
/// A sleep with a deadline sets a timer of the CPU, and a wake-up before it takes that back. On a
/// virtual machine both leave the guest, and a wake-up at that time is two to three times as late.
/// So a worker that was woken before its deadline of late keeps a timer file, which nobody reads,
/// at the next deadline. The kernel's timer of the sleep then stands behind an equal one, and
/// neither sets nor takes back anything. Deadlines that come periodically are set when the one
/// before is over, where no message is on its way yet.
///
/// @threads  Safe; each worker uses its own index.
/// @realtime `wake_one` is one load when nobody sleeps, else one system call.
class Sleepers {
 public:
  static constexpr unsigned kMaxWorkers = 64;

  Sleepers() = default;
  Sleepers(const Sleepers&) = delete;
  Sleepers& operator=(const Sleepers&) = delete;
  ~Sleepers();

  /// Says that worker `index` is about to sleep. It must look for work once more after this.
  void announce(unsigned index) noexcept;

  /// Takes an announcement back. If a waker was faster, its wake-up is consumed.
  void withdraw(unsigned index) noexcept;

  /// Sleeps until woken, or until CLOCK_MONOTONIC shows `deadline_ns` (`kNever`: no limit).
  /// Returns true if it was woken.
  bool sleep(unsigned index, std::int64_t deadline_ns) noexcept;
  /// As `sleep`; also ends, and returns false, when one of `words` shows something else than what
  /// was seen. Of more than `kMaxWatched` the rest is not watched.
  bool sleep(unsigned index, std::int64_t deadline_ns, std::span<const WatchedWord> words) noexcept;
  static constexpr std::size_t kMaxWatched = 127;

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

  /// The timer file of one worker, which alone uses it.
  class Alarm {
   public:
    Alarm() = default;
    Alarm(const Alarm&) = delete;
    Alarm& operator=(const Alarm&) = delete;
    ~Alarm();

    void before_sleep(std::int64_t deadline_ns) noexcept;
    void after_deadline() noexcept;
    void after_wake() noexcept { left_ = kDeadlines; }

   private:
    static constexpr int kDeadlines = 16;  ///< For so many the file is kept after a wake-up.

    void set(std::int64_t time_ns) noexcept;

    int file_ = -1;
    int left_ = 0;
    std::int64_t deadline_ns_ = 0;  ///< Of the last sleep that had one.
    std::int64_t step_ns_ = 0;      ///< From the deadline before to that one.
    std::int64_t set_ns_ = 0;
    bool is_periodic_ = false;  ///< The last two steps were equal.
  };

  bool take_off(unsigned index) noexcept;
  void consume(unsigned index) noexcept;

  alignas(64) std::atomic<std::uint64_t> sleeping_{0};
  std::atomic<unsigned> leader_{kMaxWorkers};
  std::array<Slot, kMaxWorkers> slots_;
  std::array<Alarm, kMaxWorkers> alarms_;
};

}  // namespace fastcycle::base

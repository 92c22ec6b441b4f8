#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/prefetch.h"

namespace fastcycle::base {

/// A word in memory that other processes write too, and the value that was read: a sleeper returns
/// when it has changed and the writer wakes it.
struct WatchedWord {
  const std::atomic<std::uint32_t>* word;
  std::uint32_t seen;
};

/// The sleeping workers of one executor (an eventcount).
///
/// A worker without work announces that it will sleep, checks once more, and sleeps. A thread with
/// work for it publishes the work, and then wakes a sleeper:
///
///     worker:  announce(i); if (found work) withdraw(i); else sleep(i, deadline);
///     waker:   put work; wake_one();
///
/// Announcing and checking, publishing and waking are sequentially consistent, so either the worker
/// sees the work or the waker sees the worker: no wake-up is lost, and no timed wait is needed to
/// hide one. The waker removes the sleeper from the set, so a burst makes one call.
///
/// A sleep with a deadline arms a timer of the CPU, and an earlier wake-up cancels it. On a virtual
/// machine both exit to the host, and such a wake-up takes two to three times as long. So a worker
/// that was recently woken before its deadline keeps a timerfd, which is never read, armed at the
/// next deadline. The kernel's timer of the sleep is then queued behind an equal one, and neither
/// arms nor cancels the CPU's timer. Periodic deadlines are armed when the previous one has passed,
/// before the next message is sent.
///
/// @threads  Safe; each worker uses its own index.
/// @realtime `wake_one` is one load if no worker sleeps, else one system call.
class Sleepers {
 public:
  static constexpr unsigned kMaxWorkers = 64;

  Sleepers() = default;
  Sleepers(const Sleepers&) = delete;
  Sleepers& operator=(const Sleepers&) = delete;
  ~Sleepers();

  /// Announces that worker `index` is about to sleep. It must check for work once more after this.
  void announce(unsigned index) noexcept;

  /// Withdraws an announcement. If a waker was faster, its wake-up is consumed.
  void withdraw(unsigned index) noexcept;

  /// Sleeps until woken, or until CLOCK_MONOTONIC reaches `deadline_ns` (`kNever`: no limit).
  /// Returns true if it was woken.
  bool sleep(unsigned index, std::int64_t deadline_ns) noexcept;
  /// As `sleep`; also ends, and returns false, when one of `words` has changed. Words beyond
  /// `kMaxWatched` are not watched.
  bool sleep(unsigned index, std::int64_t deadline_ns, std::span<const WatchedWord> words) noexcept;
  static constexpr std::size_t kMaxWatched = 127;

  /// Wakes one sleeper, if there is one: the leader only if there is no other.
  bool wake_one() noexcept;

  /// Prefetches what `wake_one` will write.
  void prepare_wake() const noexcept {
    prefetch_for_writing(&sleeping_);
    prefetch_for_writing(&slots_[0]);
  }

  /// Wakes worker `index` if it sleeps.
  bool wake(unsigned index) noexcept;

  /// Sets the worker that watches the timers, which is woken last; `kMaxWorkers` for none.
  void set_leader(unsigned index) noexcept { leader_.store(index, std::memory_order_relaxed); }

  [[nodiscard]] bool has_sleepers() const noexcept {
    return sleeping_.load(std::memory_order_seq_cst) != 0;
  }

 private:
  struct alignas(64) Slot {
    std::atomic<std::uint32_t> is_woken{0};
  };

  /// The timerfd of one worker, used only by it.
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
    static constexpr int kDeadlines =
        16;  ///< Number of deadlines for which it is kept after a wake-up.

    void set(std::int64_t time_ns) noexcept;

    int file_ = -1;
    int left_ = 0;
    std::int64_t deadline_ns_ = 0;  ///< Of the last sleep that had one.
    std::int64_t step_ns_ = 0;      ///< From the previous deadline to that one.
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

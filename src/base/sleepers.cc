#include "base/sleepers.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <ctime>

#include <linux/futex.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "base/clock.h"

namespace fastcycle::base {
namespace {

timespec to_timespec(std::int64_t ns) noexcept {
  return {.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
}

/// Waits while `word` is 0. Returns false if the deadline passed.
bool wait_while_zero(std::atomic<std::uint32_t>& word, std::int64_t deadline_ns) noexcept {
  const timespec deadline = to_timespec(deadline_ns);
  const timespec* limit = deadline_ns != kNever ? &deadline : nullptr;
  const long result = syscall(SYS_futex, &word, FUTEX_WAIT_BITSET_PRIVATE, 0, limit, nullptr,
                              FUTEX_BITSET_MATCH_ANY);
  return result == 0 || errno != ETIMEDOUT;
}

/// The same, or until one of `words` changes. Returns false if the deadline passed or such a word
/// changed.
bool wait_while_zero(std::atomic<std::uint32_t>& word, std::int64_t deadline_ns,
                     std::span<const WatchedWord> words) noexcept {
  std::array<futex_waitv, Sleepers::kMaxWatched + 1> waited;
  waited[0] = {.val = 0,
               .uaddr = reinterpret_cast<std::uintptr_t>(&word),
               .flags = FUTEX_32 | FUTEX_PRIVATE_FLAG,
               .__reserved = 0};
  unsigned count = 1;
  for (const WatchedWord& watched : words.first(std::min(words.size(), Sleepers::kMaxWatched))) {
    waited[count++] = {.val = watched.seen,
                       .uaddr = reinterpret_cast<std::uintptr_t>(watched.word),
                       .flags = FUTEX_32,
                       .__reserved = 0};
  }
  const timespec deadline = to_timespec(deadline_ns);
  const timespec* limit = deadline_ns != kNever ? &deadline : nullptr;
  static std::atomic<bool> is_missing{false};
  long result = -1;
  if (!is_missing.load(std::memory_order_relaxed)) {
    result = syscall(SYS_futex_waitv, waited.data(), count, 0, limit, CLOCK_MONOTONIC);
    is_missing.store(result < 0 && errno == ENOSYS, std::memory_order_relaxed);
  }
  if (is_missing.load(std::memory_order_relaxed)) {
    // Linux before 5.16, or valgrind: the caller looks at the words again each time.
    constexpr std::int64_t kLookNs = 1'000'000;
    wait_while_zero(word, std::min(deadline_ns, monotonic_ns() + kLookNs));
    return word.load(std::memory_order_acquire) != 0;
  }
  // EAGAIN: a word had changed before; unknown which one.
  return result == 0 || (errno == EAGAIN && word.load(std::memory_order_acquire) != 0);
}

void wake_waiter(std::atomic<std::uint32_t>& word) noexcept {
  syscall(SYS_futex, &word, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
}

}  // namespace

Sleepers::~Sleepers() = default;

Sleepers::Alarm::~Alarm() {
  if (file_ >= 0) {
    close(file_);
  }
}

void Sleepers::Alarm::set(std::int64_t time_ns) noexcept {
  if (set_ns_ == time_ns) {
    return;
  }
  set_ns_ = time_ns;
  if (file_ < 0) {
    file_ = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
  }
  // Without a file, or where it cannot be set, sleeping only costs more.
  const itimerspec at{.it_interval = {}, .it_value = to_timespec(time_ns)};
  timerfd_settime(file_, TFD_TIMER_ABSTIME, &at, nullptr);
}

void Sleepers::Alarm::before_sleep(std::int64_t deadline_ns) noexcept {
  if (deadline_ns == deadline_ns_) {
    return;
  }
  const std::int64_t step_ns = deadline_ns - deadline_ns_;
  is_periodic_ = step_ns == step_ns_;
  step_ns_ = step_ns;
  deadline_ns_ = deadline_ns;
  if (left_ > 0) {
    --left_;
    set(deadline_ns);
  }
}

void Sleepers::Alarm::after_deadline() noexcept {
  if (left_ > 0 && is_periodic_) {
    set(deadline_ns_ + step_ns_);
  }
}

void Sleepers::announce(unsigned index) noexcept {
  sleeping_.fetch_or(std::uint64_t{1} << index, std::memory_order_seq_cst);
}

bool Sleepers::take_off(unsigned index) noexcept {
  const std::uint64_t bit = std::uint64_t{1} << index;
  return (sleeping_.fetch_and(~bit, std::memory_order_seq_cst) & bit) != 0;
}

void Sleepers::consume(unsigned index) noexcept {
  auto& is_woken = slots_[index].is_woken;
  while (is_woken.load(std::memory_order_acquire) == 0) {
    wait_while_zero(is_woken, kNever);
  }
  is_woken.store(0, std::memory_order_relaxed);
}

void Sleepers::withdraw(unsigned index) noexcept {
  if (!take_off(index)) {
    consume(index);
  }
}

bool Sleepers::sleep(unsigned index, std::int64_t deadline_ns,
                     std::span<const WatchedWord> words) noexcept {
  auto& is_woken = slots_[index].is_woken;
  while (is_woken.load(std::memory_order_acquire) == 0) {
    if (!wait_while_zero(is_woken, deadline_ns, words)) {
      if (take_off(index)) {
        return false;
      }
      consume(index);
      return true;
    }
  }
  is_woken.store(0, std::memory_order_relaxed);
  return true;
}

bool Sleepers::sleep(unsigned index, std::int64_t deadline_ns) noexcept {
  auto& is_woken = slots_[index].is_woken;
  Alarm& alarm = alarms_[index];
  const bool has_deadline = deadline_ns != kNever;
  if (has_deadline) {
    alarm.before_sleep(deadline_ns);
  }
  while (is_woken.load(std::memory_order_acquire) == 0) {
    if (!wait_while_zero(is_woken, deadline_ns)) {
      if (take_off(index)) {
        alarm.after_deadline();
        return false;
      }
      // A waker was faster, and may need this CPU to continue: wait for it without a limit.
      deadline_ns = kNever;
    }
  }
  is_woken.store(0, std::memory_order_relaxed);
  if (has_deadline) {
    alarm.after_wake();
  }
  return true;
}

bool Sleepers::wake(unsigned index) noexcept {
  if (!take_off(index)) {
    return false;
  }
  slots_[index].is_woken.store(1, std::memory_order_release);
  wake_waiter(slots_[index].is_woken);
  return true;
}

bool Sleepers::wake_one() noexcept {
  std::uint64_t sleeping = sleeping_.load(std::memory_order_seq_cst);
  while (sleeping != 0) {
    const unsigned leader = leader_.load(std::memory_order_relaxed);
    const std::uint64_t others =
        leader < kMaxWorkers ? sleeping & ~(std::uint64_t{1} << leader) : sleeping;
    const auto chosen = static_cast<unsigned>(std::countr_zero(others != 0 ? others : sleeping));
    if (wake(chosen)) {
      return true;
    }
    sleeping = sleeping_.load(std::memory_order_seq_cst);
  }
  return false;
}

}  // namespace fastcycle::base

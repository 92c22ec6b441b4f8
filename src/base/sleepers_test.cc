#include "base/sleepers.h"

#include <atomic>
#include <filesystem>
#include <system_error>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "base/clock.h"

namespace fastcycle::base {
namespace {

TEST(Sleepers, WakingNobodyDoesNothing) {
  Sleepers sleepers;

  EXPECT_FALSE(sleepers.wake_one());
}

TEST(Sleepers, ASleeperThatIsNotWokenReturnsAtItsDeadline) {
  Sleepers sleepers;
  sleepers.announce(0);
  const std::int64_t deadline = monotonic_ns() + 1'000'000;

  EXPECT_FALSE(sleepers.sleep(0, deadline));

  EXPECT_GE(monotonic_ns(), deadline);
  EXPECT_FALSE(sleepers.has_sleepers());
}

TEST(Sleepers, AWakeUpBetweenAnnouncingAndSleepingIsNotLost) {
  Sleepers sleepers;
  sleepers.announce(3);

  EXPECT_TRUE(sleepers.wake_one());

  EXPECT_TRUE(sleepers.sleep(3, kNever));
}

TEST(Sleepers, AWithdrawnAnnouncementLeavesNoWakeUpBehind) {
  Sleepers sleepers;
  sleepers.announce(1);
  EXPECT_TRUE(sleepers.wake_one());
  sleepers.withdraw(1);

  sleepers.announce(1);

  EXPECT_FALSE(sleepers.sleep(1, monotonic_ns() + 100'000));
}

TEST(Sleepers, TheLeaderIsWokenLast) {
  Sleepers sleepers;
  sleepers.set_leader(0);
  sleepers.announce(0);
  sleepers.announce(5);

  EXPECT_TRUE(sleepers.wake_one());

  EXPECT_TRUE(sleepers.sleep(5, kNever));
  EXPECT_TRUE(sleepers.wake_one());
  EXPECT_TRUE(sleepers.sleep(0, kNever));
}

/// The timer files that this process holds.
int timer_files() {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;
    count += std::filesystem::read_symlink(entry, gone) == "anon_inode:[timerfd]" ? 1 : 0;
  }
  return count;
}

// The timer file that a worker keeps after early wake-ups changes nothing of when it returns.
TEST(Sleepers, ASleeperThatWasWokenBeforeItsDeadlineSleepsToTheNextAllTheSame) {
  const int files = timer_files();
  {
    Sleepers sleepers;
    std::int64_t deadline_ns = monotonic_ns();
    for (int period = 0; period < 60; ++period) {
      // Some of them in one step after the other, some not; at last without being woken.
      deadline_ns += period % 10 == 0 ? 1'700'000 : 1'000'000;
      if (period < 30) {
        sleepers.announce(0);
        EXPECT_TRUE(sleepers.wake(0));
        EXPECT_TRUE(sleepers.sleep(0, deadline_ns));
      }
      sleepers.announce(0);
      EXPECT_FALSE(sleepers.sleep(0, deadline_ns));
      EXPECT_GE(monotonic_ns(), deadline_ns);
    }
    EXPECT_EQ(timer_files(), files + 1);
  }
  EXPECT_EQ(timer_files(), files);
}

// Hands 20,000 turns back and forth; a single lost wake-up would hang it.
TEST(Sleepers, NoWakeUpIsLostBetweenTwoThreads) {
  Sleepers sleepers;
  std::atomic<int> turn{0};
  constexpr int kTurns = 20'000;
  const auto play = [&](unsigned index) {
    for (int i = static_cast<int>(index); i < kTurns; i += 2) {
      while (turn.load() != i) {
        sleepers.announce(index);
        if (turn.load() == i) {
          sleepers.withdraw(index);
        } else {
          sleepers.sleep(index, kNever);
        }
      }
      turn.store(i + 1);
      sleepers.wake(1 - index);
    }
  };

  std::thread other(play, 1);
  play(0);
  other.join();

  EXPECT_EQ(turn.load(), kTurns);
}

// Sleepers whose time is over meet their wakers; one of them leads in turn. Each wake-up that was
// given is taken once.
TEST(Sleepers, EachWakeUpIsTakenOnceAlsoAtTheDeadline) {
  constexpr unsigned kSleepers = 3;
  constexpr int kRounds = 3'000;
  Sleepers sleepers;
  std::atomic<unsigned> sleeping{kSleepers};
  std::atomic<int> given{0};
  std::atomic<int> taken{0};
  std::vector<std::thread> threads;
  for (unsigned index = 0; index < kSleepers; ++index) {
    threads.emplace_back([&, index] {
      for (int i = 0; i < kRounds; ++i) {
        sleepers.announce(index);
        sleepers.set_leader(index);
        taken += sleepers.sleep(index, monotonic_ns() + i % 4 * 1'000) ? 1 : 0;
      }
      --sleeping;
    });
  }
  threads.emplace_back([&] {
    for (unsigned index = 0; sleeping > 0; index = (index + 1) % kSleepers) {
      given += sleepers.wake(index) ? 1 : 0;
      std::this_thread::yield();
    }
  });
  while (sleeping > 0) {
    given += sleepers.wake_one() ? 1 : 0;
    std::this_thread::yield();
  }
  for (std::thread& thread : threads) {
    thread.join();
  }

  EXPECT_EQ(given, taken);
  EXPECT_FALSE(sleepers.has_sleepers());
}

}  // namespace
}  // namespace fastcycle::base

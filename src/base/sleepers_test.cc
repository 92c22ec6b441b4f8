#include "base/sleepers.h"

#include <atomic>
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

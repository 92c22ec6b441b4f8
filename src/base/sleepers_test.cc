#include "base/sleepers.h"

#include <thread>

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

}  // namespace
}  // namespace fastcycle::base

#include "base/giving_way.h"

#include <future>
#include <thread>

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

int policy_of_this() {
  return sched_getscheduler(0);
}

/// Tries `act` on a thread of its own, whose policy nobody else minds.
template <typename Act>
void on_a_thread(const Act& act) {
  std::thread(act).join();
}

bool gives_way_here() {
  bool gives_way = false;
  on_a_thread([&] {
    GivingWay way;
    way.adopt();
    way.begin();
    gives_way = policy_of_this() == SCHED_IDLE;
    way.end();
  });
  return gives_way;
}

TEST(AThreadThatGivesWay, SharesAgainAfterwards) {
  if (!gives_way_here()) {
    GTEST_SKIP() << "not permitted here";
  }
  on_a_thread([] {
    const int before = policy_of_this();
    GivingWay way;
    way.adopt();
    EXPECT_EQ(policy_of_this(), before);
    for (int i = 0; i < 2; ++i) {
      way.begin();
      EXPECT_EQ(policy_of_this(), SCHED_IDLE);
      way.end();
      EXPECT_EQ(policy_of_this(), before);
    }
  });
}

TEST(AThreadThatGivesWay, SharesAtOnceWhenSomebodyIsInAHurry) {
  if (!gives_way_here()) {
    GTEST_SKIP() << "not permitted here";
  }
  on_a_thread([] {
    const int before = policy_of_this();
    const pid_t id = gettid();
    GivingWay way;
    way.adopt();
    way.begin();
    on_a_thread([&] {
      EXPECT_EQ(sched_getscheduler(id), SCHED_IDLE);
      way.hurry(true);
      EXPECT_EQ(sched_getscheduler(id), before);
    });
    way.end();
    way.begin();
    EXPECT_EQ(policy_of_this(), before);
    way.end();
    on_a_thread([&] { way.hurry(false); });
    way.begin();
    EXPECT_EQ(policy_of_this(), SCHED_IDLE);
    way.end();
  });
}

TEST(AThreadThatGivesWay, IsLeftAloneIfItWasNotAdopted) {
  on_a_thread([] {
    const int before = policy_of_this();
    GivingWay way;
    way.begin();
    EXPECT_EQ(policy_of_this(), before);
    way.end();
    way.hurry(true);
    EXPECT_EQ(policy_of_this(), before);
  });
}

TEST(AThreadThatGivesWay, HasTheNicenessThatItHad) {
  on_a_thread([] {
    const int before = getpriority(PRIO_PROCESS, 0);
    GivingWay way;
    way.adopt();
    EXPECT_EQ(getpriority(PRIO_PROCESS, 0), before);
    way.begin();
    way.end();
    EXPECT_EQ(getpriority(PRIO_PROCESS, 0), before);
  });
}

TEST(AThreadThatGivesWay, KeepsARealTimePolicy) {
  on_a_thread([] {
    const sched_param parameter{.sched_priority = 1};
    if (sched_setscheduler(0, SCHED_FIFO, &parameter) != 0) {
      GTEST_SKIP() << "not permitted here";
    }
    GivingWay way;
    way.adopt();
    way.begin();
    EXPECT_EQ(policy_of_this(), SCHED_FIFO);
    way.end();
  });
}

}  // namespace
}  // namespace fastcycle::base

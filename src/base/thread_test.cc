#include "base/thread.h"

#include <array>

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/prctl.h>

#include "base/priority.h"
#include "base/signal_stack.h"

namespace fastcycle::base {
namespace {

TEST(Thread, HasItsNameAndATimerSlackOfOneNanosecond) {
  std::array<char, 16> name{};
  int slack_ns = 0;
  std::vector<Refusal> refusals;

  Thread thread(
      {.name = "control", .cpus = {}},
      [&] {
        pthread_getname_np(pthread_self(), name.data(), name.size());
        slack_ns = prctl(PR_GET_TIMERSLACK);
      },
      refusals);
  thread.join();

  EXPECT_STREQ(name.data(), "control");
  EXPECT_EQ(slack_ns, 1);
  EXPECT_TRUE(refusals.empty());
}

TEST(Thread, HasAStackOfItsOwnForSignalHandlers) {
  stack_t stack{};
  std::vector<Refusal> refusals;

  Thread thread({.name = "t", .cpus = {}}, [&] { sigaltstack(nullptr, &stack); }, refusals);
  thread.join();

  EXPECT_EQ(stack.ss_flags & SS_DISABLE, 0);
  EXPECT_GE(stack.ss_size, SignalStack::kSize);
}

TEST(Thread, GivesWayToAllOthersIfAskedTo) {
  int policy = -1;
  std::vector<Refusal> refusals;

  Thread thread(
      {.name = "t", .cpus = {}, .policy = SchedulingPolicy::kIdle},
      [&] { policy = sched_getscheduler(0); }, refusals);
  thread.join();

  EXPECT_EQ(policy, SCHED_IDLE);
  EXPECT_TRUE(refusals.empty());
}

TEST(Thread, HasItsTimeSliceOrReportsThatTheKernelHasNone) {
  bool has_slices = false;
  std::vector<Refusal> refusals;

  Thread thread(
      {.name = "t", .cpus = {}, .slice_us = 200},
      [&] { has_slices = set_time_slice(std::chrono::microseconds(300)); }, refusals);
  thread.join();

  ASSERT_EQ(refusals.size(), has_slices ? 0U : 1U);
  if (!has_slices) {
    EXPECT_EQ(refusals[0].what.find("slice_us 200 for thread t"), 0U);
  }
}

TEST(Thread, SaysWhatTheMachineRefusesAndRunsAllTheSame) {
  bool has_run = false;
  std::vector<Refusal> refusals;

  Thread thread({.name = "t", .cpus = {1000}}, [&] { has_run = true; }, refusals);
  thread.join();

  EXPECT_TRUE(has_run);
  ASSERT_EQ(refusals.size(), 1U);
  EXPECT_NE(refusals[0].what.find("cpus 1000"), std::string::npos);
  EXPECT_FALSE(refusals[0].remedy.empty());
}

}  // namespace
}  // namespace fastcycle::base

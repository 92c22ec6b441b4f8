#include "measure/floors.h"

#include <atomic>

#include <gtest/gtest.h>

#include "measure/queue_floors.h"

namespace fastcycle::measure {
namespace {

/// Short, and faster than most machines can follow.
Plan hasty_plan(std::int64_t size = 64) {
  return {.size = size, .count = 3000, .warmup = 10, .interval_us = 1};
}

/// All messages, in order, with stamps that do not go back.
void expect_complete(const Measured& measured, const Plan& plan) {
  ASSERT_EQ(measured.samples.size(), static_cast<std::size_t>(plan.warmup + plan.count));
  std::int64_t number = 0;
  for (const Sample& sample : measured.samples) {
    ASSERT_EQ(sample.number, number++);
    ASSERT_LE(sample.made_ns, sample.sent_ns);
    ASSERT_LE(sample.sent_ns, sample.arrived_ns);
  }
}

TEST(Floors, LatencyLosesNothing) {
  expect_complete(floor_latency(hasty_plan(), Waiting::kFutex), hasty_plan());
  expect_complete(floor_latency(hasty_plan(4096), Waiting::kSpin), hasty_plan());
  expect_complete(floor_processes(hasty_plan(), Waiting::kFutex), hasty_plan());
  expect_complete(floor_processes(hasty_plan(4096), Waiting::kSpin), hasty_plan());
}

TEST(Floors, RoundTripLosesNothing) {
  expect_complete(floor_rtt(hasty_plan(), Waiting::kFutex), hasty_plan());
  // Two threads that spin on one CPU wait for each other until the system takes it from them.
  Plan few = hasty_plan();
  few.count = 100;
  expect_complete(floor_rtt(few, Waiting::kSpin), few);
}

TEST(Floors, MallocLosesNothing) {
  expect_complete(floor_malloc(hasty_plan(100'000)), hasty_plan());
}

TEST(Floors, TimerTicksAtWholeIntervals) {
  const Plan plan = hasty_plan();

  const Measured measured = floor_timer(plan);

  expect_complete(measured, plan);
  EXPECT_EQ(measured.samples.back().sent_ns - measured.samples.front().sent_ns,
            (plan.warmup + plan.count - 1) * 1000);
}

TEST(Floors, FloodLosesNothing) {
  const Flood flood = floor_flood({.size = 64, .count = 20'001}, 16, 5);

  EXPECT_EQ(flood.sent, 20'001);
  EXPECT_EQ(flood.received, 20'001);
  EXPECT_EQ(flood.damaged, 0);
  EXPECT_LT(flood.first_sent_ns, flood.last_received_ns);
}

TEST(Floors, EndWhenTheyAreStopped) {
  const std::atomic<bool> stop{true};
  const Plan plan{.size = 64, .count = 1'000'000'000, .warmup = 0, .stop = &stop};

  // Nothing is reserved for so many.
  EXPECT_EQ(floor_flood(plan, 16).received, 0);
}

}  // namespace
}  // namespace fastcycle::measure

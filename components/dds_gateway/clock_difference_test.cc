#include "dds_gateway/clock_difference.h"

#include <chrono>
#include <random>

#include <gtest/gtest.h>

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;

constexpr Time kStart{1'700'000'000s};

/// A round trip to a clock that is `ahead`, asked at `asked`.
RoundTrip round_trip(Time asked, Duration ahead, Duration there, Duration back,
                     Duration answering = 1ms) {
  const Time came = asked + there + ahead;
  return {.asked = asked,
          .came = came,
          .answered = came + answering,
          .back = asked + there + answering + back};
}

TEST(ClockDifference, NothingIsKnownBeforeAnAnswerCame) {
  const ClockDifference difference;
  EXPECT_FALSE(difference.at(kStart).has_value());
}

TEST(ClockDifference, EqualWaysGiveTheDifferenceItself) {
  for (const Duration ahead : {Duration(250ms), Duration(-3600s), Duration(0)}) {
    ClockDifference difference;
    difference.add(round_trip(kStart, ahead, 200us, 200us));

    const auto found = difference.at(kStart + 1400us);

    ASSERT_TRUE(found.has_value());
    EXPECT_EQ(found->ahead, ahead);
    EXPECT_EQ(found->round_trip, 400us);
    EXPECT_EQ(found->bound, 200us);
  }
}

// Whatever waits on either way, the true difference is within what is said.
TEST(ClockDifference, TheDifferenceIsWithinItsBound) {
  std::mt19937 random(7);
  std::exponential_distribution<double> waiting_us(1.0 / 500.0);
  const auto way = [&] {
    return 50us + Duration(static_cast<std::int64_t>(waiting_us(random) * 1e3));
  };
  constexpr double kDrift = 40e-6;
  ClockDifference difference;
  Duration smallest = 1h;

  for (int i = 0; i < 1000; ++i) {
    const Time now = kStart + i * 200ms;
    const auto ahead_at = [&](Time time) {
      return 12ms + Duration(static_cast<std::int64_t>(
                        static_cast<double>((time - kStart).count()) * kDrift));
    };
    const RoundTrip trip = round_trip(now, ahead_at(now), way(), way());
    difference.add(trip);

    const auto found = difference.at(trip.back);

    ASSERT_TRUE(found.has_value());
    const Duration off = found->ahead - ahead_at(trip.back);
    ASSERT_LE(std::chrono::abs(off), found->bound + 1us) << i;
    smallest = std::min(smallest, found->bound);
  }

  EXPECT_LT(smallest, 200us);
}

TEST(ClockDifference, TheShortestOfTheLastRoundTripsCounts) {
  ClockDifference difference;
  difference.add(round_trip(kStart, 5ms, 100us, 100us));
  difference.add(round_trip(kStart + 100ms, 5ms, 20ms, 100us));

  const auto found = difference.at(kStart + 130ms);

  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->ahead, 5ms);
  EXPECT_EQ(found->round_trip, 200us);
}

TEST(ClockDifference, ItIsKnownLessAndLessWhenNothingComesBack) {
  ClockDifference difference;
  difference.add(round_trip(kStart, 5ms, 100us, 100us));

  EXPECT_EQ(difference.at(kStart + 10s + 1200us)->bound, 100us + 1ms);
}

TEST(ClockDifference, AfterAClockWasSetOnlyTheNewestCount) {
  ClockDifference difference;
  difference.add(round_trip(kStart, 5ms, 100us, 100us));
  difference.add(round_trip(kStart + 100ms, -2s, 4ms, 3ms));

  const auto found = difference.at(kStart + 110ms);

  ASSERT_TRUE(found.has_value());
  EXPECT_LE(std::chrono::abs(found->ahead + 2s), found->bound);
}

TEST(ClockDifference, WhatNoTwoClocksCanHaveSeenIsLeftOut) {
  ClockDifference difference;
  difference.add({.asked = kStart, .came = kStart, .answered = kStart - 1ms, .back = kStart + 1s});
  difference.add({.asked = kStart, .came = kStart, .answered = kStart + 2s, .back = kStart + 1s});

  EXPECT_FALSE(difference.at(kStart + 1s).has_value());
}

}  // namespace
}  // namespace fastcycle::dds_gateway

#include "broker/chain_end.h"

#include <array>
#include <chrono>
#include <cstdint>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::detail {
namespace {

using namespace std::chrono_literals;

constexpr Time at(Duration since_start) {
  return Time(1000s) + since_start;
}

/// A message taken at 0, published at once by 1, and by 2, 3, … each so much later: first waiting,
/// then running.
Trail trail_of(const std::vector<std::pair<Duration, Duration>>& hops) {
  Trail trail;
  trail.begin(at(0s), 1, at(0s));
  Time now = at(0s);
  PublisherId publisher = 2;
  for (const auto& [waiting, running] : hops) {
    const Time begin = now + waiting;
    now = begin + running;
    trail.add({.publisher = publisher++, .begin = begin, .published = now});
  }
  return trail;
}

ChainEnd end_of(Duration deadline, bool drops = false) {
  const std::array rules{ChainRule{.chain = 0, .root = 0, .deadline = deadline, .drops = drops}};
  return ChainEnd(rules);
}

std::uint64_t breaches_by(const ChainEnd::HopStatistics& hop) {
  return hop.breaches_by_waiting.get() + hop.breaches_by_running.get();
}

TEST(AChainEnd, DropsOnlyWhatIsOlderThanItsDeadline) {
  ChainEnd end = end_of(10ms, true);
  const Trail trail = trail_of({{1ms, 2ms}});

  EXPECT_FALSE(end.judge(&trail, at(10ms)).is_dropped);
  const auto verdict = end.judge(&trail, at(10ms + 1ns));

  EXPECT_TRUE(verdict.is_dropped);
  EXPECT_EQ(verdict.breached, 1U);
  EXPECT_EQ(end.stale.get(), 1U);
  EXPECT_EQ(end.chains()[0]->age.count(), 2U);
  EXPECT_EQ(end.chains()[0]->breaches.get(), 1U);
}

TEST(AChainEnd, DoesNotJudgeWhatDidNotComeFromItsRoot) {
  ChainEnd end = end_of(1ns, true);
  const Trail unknown;

  EXPECT_FALSE(end.judge(&unknown, at(1s)).is_dropped);
  EXPECT_FALSE(end.judge(nullptr, at(1s)).is_dropped);

  EXPECT_EQ(end.chains()[0]->age.count(), 0U);
}

TEST(AChainEnd, SplitsTheWholeAgeIntoWaitingAndRunning) {
  ChainEnd end = end_of(1s);
  const Trail trail = trail_of({{1ms, 2ms}, {3ms, 4ms}});

  static_cast<void>(end.judge(&trail, at(15ms)));

  const ChainEnd::Chain& chain = *end.chains()[0];
  ASSERT_EQ(chain.hop_count.load(), 4U);
  double sum_ns = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    sum_ns += chain.hops[i].waiting.summary().max + chain.hops[i].running.summary().max;
  }
  EXPECT_EQ(sum_ns, 15e6);
  EXPECT_EQ(chain.hops[1].waiting.summary().max, 1e6);
  EXPECT_EQ(chain.hops[1].running.summary().max, 2e6);
  EXPECT_EQ(chain.hops[3].publisher.load(), 0U) << "the receiver";
  EXPECT_EQ(chain.hops[3].waiting.summary().max, 5e6);
}

TEST(AChainEnd, BlamesTheHopThatTookMoreThanUsualNotTheLongest) {
  ChainEnd end = end_of(30ms);
  const Trail in_time = trail_of({{0ms, 20ms}, {0ms, 1ms}});
  const Trail late = trail_of({{0ms, 21ms}, {0ms, 12ms}});

  for (int i = 0; i < 10; ++i) {
    static_cast<void>(end.judge(&in_time, at(21ms)));
  }
  static_cast<void>(end.judge(&late, at(33ms)));

  const auto& hops = end.chains()[0]->hops;
  EXPECT_EQ(breaches_by(hops[1]), 0U);
  EXPECT_EQ(hops[2].breaches_by_running.get(), 1U);
  EXPECT_EQ(hops[2].breaches_by_waiting.get(), 0U);
}

TEST(AChainEnd, BlamesTheLongestHopAsLongAsNothingWasInTime) {
  ChainEnd end = end_of(30ms);
  const Trail late = trail_of({{21ms, 0ms}, {0ms, 12ms}});

  static_cast<void>(end.judge(&late, at(33ms)));

  EXPECT_EQ(end.chains()[0]->hops[1].breaches_by_waiting.get(), 1U);
  EXPECT_EQ(breaches_by(end.chains()[0]->hops[2]), 0U);
}

TEST(AChainEnd, BlamesTheReceiverForItsQueue) {
  ChainEnd end = end_of(5ms);
  const Trail trail = trail_of({{0ms, 1ms}});

  static_cast<void>(end.judge(&trail, at(2ms)));
  static_cast<void>(end.judge(&trail, at(9ms)));

  EXPECT_EQ(end.chains()[0]->hops[2].breaches_by_waiting.get(), 1U);
}

TEST(AChainEnd, HasRoomForSoManyPublishersAndCountsTheRestForTheLast) {
  ChainEnd end = end_of(1s);
  for (PublisherId publisher = 1; publisher <= 100; ++publisher) {
    Trail trail;
    trail.begin(at(0s), publisher, at(1ms));
    static_cast<void>(end.judge(&trail, at(2ms)));
  }

  const ChainEnd::Chain& chain = *end.chains()[0];
  EXPECT_EQ(chain.hop_count.load(), ChainEnd::kMaxHops);
  std::uint64_t count = 0;
  for (const auto& hop : chain.hops) {
    count += hop.waiting.count();
  }
  EXPECT_EQ(count, 200U) << "two hops each";
}

TEST(ATrail, AddsUpHoweverLongItIs) {
  const Trail trail = trail_of(std::vector<std::pair<Duration, Duration>>(100, {1ms, 1ms}));

  EXPECT_EQ(trail.hops().size(), Trail::kMaxHops);
  EXPECT_EQ(trail.hops().back().published, at(200ms));
  ChainEnd end = end_of(1s);
  static_cast<void>(end.judge(&trail, at(201ms)));
  double sum_ns = 0;
  for (const auto& hop : end.chains()[0]->hops) {
    sum_ns += hop.waiting.summary().max + hop.running.summary().max;
  }
  EXPECT_EQ(sum_ns, 201e6);
}

}  // namespace
}  // namespace fastcycle::detail

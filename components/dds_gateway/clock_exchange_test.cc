#include "dds_gateway/clock_exchange.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "dds_gateway/test_network.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::Field;

/// One application's end: a participant with a clock of its own.
struct End {
  End(const char* engine, const char* node, Duration ahead, ClockSource source)
      : participant(
            std::ranges::find_if(engines(),
                                 [&](const Engine& one) { return one.name == std::string(engine); })
                ->create({.domain = domain_of_test(),
                          .interface = "lo",
                          .user_data = "",
                          .security = ""})) {
    clock.restart(clock.now() + ahead);
    exchange.emplace(*participant, clock, node, "", source);
  }
  /// How far the clock of `other` is ahead, exactly: both count the same monotonic clock.
  [[nodiscard]] Duration ahead_of_ours(const End& other) const {
    return other.clock.at_monotonic(0) - clock.at_monotonic(0);
  }
  void serve() {
    (void)exchange->ask();
    participant->serve(1ms);
  }

  base::Clock clock = base::Clock::live();
  std::unique_ptr<Participant> participant;
  std::optional<ClockExchange> exchange;
};

class ClockExchangeTest : public ::testing::TestWithParam<const char*> {
 protected:
  static void serve_until(std::vector<End*> ends, const std::function<bool()>& is_done) {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (!is_done()) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << "it did not come";
      for (End* const one : ends) {
        one->serve();
      }
    }
  }
};

TEST_P(ClockExchangeTest, FindsHowFarTheOtherClockIsAhead) {
  End here(GetParam(), "/here", 0s, ClockSource::kRoundTrips);
  End there(GetParam(), "/there", 5s, ClockSource::kRoundTrips);

  serve_until({&here, &there}, [&] {
    return here.exchange->ahead(there.exchange->id()) && there.exchange->ahead(here.exchange->id());
  });

  const auto seen = here.exchange->peers();
  ASSERT_THAT(seen, ElementsAre(Field(&ClockPeer::node, "/there")));
  EXPECT_LE(std::chrono::abs(seen[0].estimate.ahead - here.ahead_of_ours(there)),
            seen[0].estimate.bound + 1ns);
  EXPECT_LT(seen[0].estimate.bound, 1s);
  const auto other = there.exchange->peers();
  ASSERT_THAT(other, ElementsAre(Field(&ClockPeer::node, "/here")));
  EXPECT_LE(std::chrono::abs(other[0].estimate.ahead - there.ahead_of_ours(here)),
            other[0].estimate.bound + 1ns);
}

TEST_P(ClockExchangeTest, OfSeveralEachIsDistinguished) {
  End here(GetParam(), "/here", 0s, ClockSource::kRoundTrips);
  End second(GetParam(), "/second", 2s, ClockSource::kRoundTrips);
  End third(GetParam(), "/third", -3s, ClockSource::kRoundTrips);

  serve_until({&here, &second, &third}, [&] { return here.exchange->peers().size() == 2; });

  EXPECT_GT(*here.exchange->ahead(second.exchange->id()), 1s);
  EXPECT_LT(*here.exchange->ahead(third.exchange->id()), -2s);
}

// Both applications of this test have the system clock of one machine, which is equal to itself.
TEST_P(ClockExchangeTest, ByTheSystemClocksNothingDependsOnRoundTrips) {
  End here(GetParam(), "/here", 0s, ClockSource::kSystem);
  End there(GetParam(), "/there", 5s, ClockSource::kSystem);

  serve_until({&here, &there}, [&] { return !here.exchange->peers().empty(); });

  const ClockPeer seen = here.exchange->peers().at(0);
  EXPECT_LT(std::chrono::abs(seen.estimate.ahead - here.ahead_of_ours(there)), 100ms);
  EXPECT_LT(seen.system_apart, 100ms);
}

TEST_P(ClockExchangeTest, AClockThatNeverAnsweredIsUnknown) {
  const End here(GetParam(), "/here", 0s, ClockSource::kRoundTrips);

  EXPECT_FALSE(here.exchange->ahead(12345).has_value());
  EXPECT_TRUE(here.exchange->peers().empty());
}

INSTANTIATE_TEST_SUITE_P(Engines, ClockExchangeTest, ::testing::ValuesIn([] {
                           std::vector<const char*> all;
                           for (const Engine& engine : engines()) {
                             all.push_back(engine.name);
                           }
                           return all;
                         }()),
                         [](const auto& engine) { return std::string(engine.param); });

}  // namespace
}  // namespace fastcycle::dds_gateway

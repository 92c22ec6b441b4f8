#include "record/courtesy.h"

#include <gtest/gtest.h>

namespace fastcycle::record {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;

TEST(ACourtesy, GivesWayWhileNothingIsLate) {
  Courtesy courtesy;
  EXPECT_TRUE(courtesy.gives_way(0, std::nullopt));
  EXPECT_TRUE(courtesy.gives_way(15 * kMillisecond, 0));
  EXPECT_TRUE(courtesy.gives_way(500 * kMillisecond, 490 * kMillisecond));
}

TEST(ACourtesy, EndsWhenSomethingIsLateAndReturnsOnceNothingWasForASecond) {
  Courtesy courtesy;
  EXPECT_FALSE(courtesy.gives_way(16 * kMillisecond, 0));
  EXPECT_FALSE(courtesy.gives_way(17 * kMillisecond, std::nullopt));
  EXPECT_FALSE(courtesy.gives_way(1016 * kMillisecond, 1010 * kMillisecond));
  EXPECT_TRUE(courtesy.gives_way(1017 * kMillisecond, std::nullopt));
}

TEST(ACourtesy, CountsTheSecondFromWhatWasLateLast) {
  Courtesy courtesy;
  EXPECT_FALSE(courtesy.gives_way(100 * kMillisecond, 0));
  EXPECT_FALSE(courtesy.gives_way(900 * kMillisecond, 800 * kMillisecond));
  EXPECT_FALSE(courtesy.gives_way(1800 * kMillisecond, std::nullopt));
  EXPECT_TRUE(courtesy.gives_way(1901 * kMillisecond, std::nullopt));
}

}  // namespace
}  // namespace fastcycle::record

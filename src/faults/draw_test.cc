#include "faults/draw.h"

#include <gtest/gtest.h>

namespace fastcycle::faults {
namespace {

TEST(Draw, DependsOnAllOfSeedFaultPublisherAndSequence) {
  const std::uint64_t one = draw(1, "drop_1", 7, 100);

  EXPECT_EQ(draw(1, "drop_1", 7, 100), one);
  EXPECT_NE(draw(2, "drop_1", 7, 100), one);
  EXPECT_NE(draw(1, "drop_2", 7, 100), one);
  EXPECT_NE(draw(1, "drop_1", 8, 100), one);
  EXPECT_NE(draw(1, "drop_1", 7, 101), one);
}

// A log of last year repeats with its seed: these numbers stay.
TEST(Draw, IsTheSameOnEveryMachine) {
  EXPECT_EQ(mixed(0), 0xe220a8397b1dcdafULL);
  EXPECT_EQ(mixed(1), 0x910a2dec89025cc1ULL);
}

TEST(Draw, IsEvenlySpread) {
  int below_a_quarter = 0;
  for (std::uint64_t sequence = 0; sequence < 10'000; ++sequence) {
    const double unit = unit_of(draw(3, "x", 5, sequence));
    ASSERT_GE(unit, 0.0);
    ASSERT_LT(unit, 1.0);
    below_a_quarter += unit < 0.25 ? 1 : 0;
  }
  EXPECT_NEAR(below_a_quarter, 2500, 150);
}

}  // namespace
}  // namespace fastcycle::faults

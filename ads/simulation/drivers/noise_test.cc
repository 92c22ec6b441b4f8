#include "noise.h"

#include <cmath>

#include <gtest/gtest.h>

namespace ads {
namespace {

TEST(NormalTable, HasMeanZeroAndVarianceOne) {
  const NormalTable normal;
  double sum = 0.0;
  double square = 0.0;
  for (std::uint64_t bits = 0; bits < 4096; ++bits) {
    sum += static_cast<double>(normal(bits));
    square += static_cast<double>(normal(bits)) * static_cast<double>(normal(bits));
  }

  EXPECT_NEAR(sum / 4096.0, 0.0, 1e-6);
  EXPECT_NEAR(square / 4096.0, 1.0, 1e-2);
}

TEST(NormalTable, OnlyTheLowestTwelveBitsCount) {
  const NormalTable normal;

  EXPECT_EQ(normal(5), normal(5 + 4096 * 77));
}

TEST(GaussMarkov, KeepsItsSizeAndForgetsWithinItsTime) {
  std::mt19937_64 random(1);
  GaussMarkov error(0.15, 60.0);
  double last = error.step(0.0, random);
  double square = 0.0;
  double product = 0.0;
  const int steps = 50'000;
  for (int step = 0; step < steps; ++step) {
    const double next = error.step(30.0, random);
    square += next * next;
    product += next * last;
    last = next;
  }

  EXPECT_NEAR(std::sqrt(square / steps), 0.15, 0.005);
  EXPECT_NEAR(product / square, std::exp(-0.5), 0.02);
}

}  // namespace
}  // namespace ads

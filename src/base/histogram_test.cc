#include "base/histogram.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::base {
namespace {

TEST(Histogram, AnEmptyOneSummarizesToZeros) {
  const Histogram histogram;

  EXPECT_EQ(histogram.summary().count, 0U);
  EXPECT_EQ(histogram.summary().max, 0.0);
}

TEST(Histogram, PercentilesAreWithinABucketOfTheExactOnes) {
  Histogram histogram;
  std::mt19937_64 random(1);
  std::lognormal_distribution<double> distribution(9.0, 2.0);
  std::vector<double> values;
  for (int i = 0; i < 20'000; ++i) {
    const auto value = static_cast<std::int64_t>(distribution(random));
    values.push_back(static_cast<double>(value));
    histogram.record(value);
  }
  std::sort(values.begin(), values.end());

  const HistogramSummary summary = histogram.summary();

  EXPECT_EQ(summary.count, values.size());
  EXPECT_EQ(summary.max, values.back());
  EXPECT_NEAR(summary.p50, values[9'999], values[9'999] / 16);
  EXPECT_NEAR(summary.p99, values[19'799], values[19'799] / 16);
  EXPECT_NEAR(summary.p999, values[19'979], values[19'979] / 16);
}

TEST(Histogram, MeanAndDeviationAreExact) {
  Histogram histogram;
  for (const std::int64_t value : {1000, 3000, 1000, 3000}) {
    histogram.record(value);
  }

  EXPECT_DOUBLE_EQ(histogram.summary().mean, 2000.0);
  EXPECT_DOUBLE_EQ(histogram.summary().standard_deviation, 1000.0);
}

TEST(Histogram, ShortTimesAreToldApartByFourNanoseconds) {
  Histogram histogram;
  histogram.record(0);
  histogram.record(41);
  histogram.record(90);

  EXPECT_NEAR(histogram.summary().p50, 41, 4);
}

TEST(Histogram, CountsBeyondThirtyTwoBits) {
  Histogram histogram;

  histogram.record(1000, UINT32_MAX);
  histogram.record(1000);
  histogram.record(1000, UINT32_MAX);
  histogram.record(9'000'000);

  EXPECT_EQ(histogram.count(), 2ULL * UINT32_MAX + 2);
  EXPECT_NEAR(histogram.summary().p999, 1000, 1000.0 / 16);
}

TEST(Histogram, TakesAnyValue) {
  Histogram histogram;

  histogram.record(-5);
  histogram.record(INT64_MAX);

  EXPECT_EQ(histogram.summary().count, 2U);
  EXPECT_EQ(histogram.summary().max, static_cast<double>(INT64_MAX));
}

TEST(Histogram, MergedIsAsIfAllHadBeenRecordedInOne) {
  Histogram first;
  Histogram second;
  Histogram both;
  for (std::int64_t value = 1; value < 10'000'000; value = value * 3 + 1) {
    first.record(value);
    second.record(value / 2, 70'000);
    both.record(value);
    both.record(value / 2, 70'000);
  }

  first.merge(second);

  EXPECT_EQ(first.summary().count, both.summary().count);
  EXPECT_EQ(first.summary().p50, both.summary().p50);
  EXPECT_EQ(first.summary().p99, both.summary().p99);
  EXPECT_EQ(first.summary().max, both.summary().max);
  EXPECT_NEAR(first.summary().mean, both.summary().mean, 1.0);
}

}  // namespace
}  // namespace fastcycle::base

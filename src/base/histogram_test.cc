#include "base/histogram.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::base {
namespace {

template <typename T>
class Histograms : public testing::Test {};

using BothHistograms = testing::Types<Histogram, CoarseHistogram>;
TYPED_TEST_SUITE(Histograms, BothHistograms);

/// How wide a bucket is, of its value.
template <typename T>
constexpr double kWidth = 1.0 / 16;
template <>
constexpr double kWidth<CoarseHistogram> = 1.0 / 8;

TYPED_TEST(Histograms, AnEmptyOneSummarizesToZeros) {
  const TypeParam histogram;

  EXPECT_EQ(histogram.summary().count, 0U);
  EXPECT_EQ(histogram.summary().max, 0.0);
}

TYPED_TEST(Histograms, PercentilesAreWithinABucketOfTheExactOnes) {
  TypeParam histogram;
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
  EXPECT_NEAR(summary.p50, values[9'999], values[9'999] * kWidth<TypeParam>);
  EXPECT_NEAR(summary.p99, values[19'799], values[19'799] * kWidth<TypeParam>);
  EXPECT_NEAR(summary.p999, values[19'979], values[19'979] * kWidth<TypeParam>);
}

TYPED_TEST(Histograms, MeanAndDeviationAreExact) {
  TypeParam histogram;
  for (const std::int64_t value : {1000, 3000, 1000, 3000}) {
    histogram.record(value);
  }

  EXPECT_DOUBLE_EQ(histogram.summary().mean, 2000.0);
  EXPECT_DOUBLE_EQ(histogram.summary().standard_deviation, 1000.0);
}

TYPED_TEST(Histograms, ShortTimesAreDistinguishedByFourNanoseconds) {
  TypeParam histogram;
  histogram.record(0);
  histogram.record(41);
  histogram.record(90);

  EXPECT_NEAR(histogram.summary().p50, 41, 4);
}

TYPED_TEST(Histograms, CountsBeyondThirtyTwoBits) {
  TypeParam histogram;

  histogram.record(1000, UINT32_MAX);
  histogram.record(1000);
  histogram.record(1000, UINT32_MAX);
  histogram.record(9'000'000);

  EXPECT_EQ(histogram.count(), 2ULL * UINT32_MAX + 2);
  EXPECT_NEAR(histogram.summary().p999, 1000, 1000 * kWidth<TypeParam>);
  EXPECT_NEAR(histogram.summary().mean, 1000, 1);
  EXPECT_EQ(histogram.summary().max, 9'000'000.0);
}

TYPED_TEST(Histograms, WhatFilledABucketWeighsLessAfterIt) {
  TypeParam histogram;

  histogram.record(1000, UINT32_MAX);
  histogram.record(9'000'000, UINT32_MAX / 2);
  histogram.record(1000);

  EXPECT_EQ(histogram.count(), std::uint64_t{UINT32_MAX} + UINT32_MAX / 2 + 1);
  EXPECT_NEAR(histogram.summary().p50, 1000, 1000 * kWidth<TypeParam>);
  histogram.record(9'000'000, UINT32_MAX / 2);
  EXPECT_NEAR(histogram.summary().p50, 9'000'000, 9'000'000 * kWidth<TypeParam>);
}

TYPED_TEST(Histograms, TellsApartWhatIsABucketWide) {
  TypeParam histogram;
  const double wider = 1'000'000 * (1 + 1.01 * kWidth<TypeParam>);
  histogram.record(1'000'000);
  histogram.record(static_cast<std::int64_t>(wider));
  histogram.record(4'294'000'000);

  EXPECT_NEAR(histogram.summary().p50, wider, wider * kWidth<TypeParam> / 2);
  EXPECT_NEAR(histogram.summary().p99, 4.294e9, 4.294e9 * kWidth<TypeParam>);
}

TYPED_TEST(Histograms, TakesAnyValue) {
  TypeParam histogram;

  histogram.record(-5);
  histogram.record(INT64_MAX);

  EXPECT_EQ(histogram.summary().count, 2U);
  EXPECT_EQ(histogram.summary().max, static_cast<double>(INT64_MAX));
}

TYPED_TEST(Histograms, MergedIsAsIfAllHadBeenRecordedInOne) {
  TypeParam first;
  TypeParam second;
  TypeParam both;
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

TYPED_TEST(Histograms, CountWhatIsBelowEachBound) {
  TypeParam histogram;
  histogram.record(0);
  histogram.record(1023);
  histogram.record(1024);
  histogram.record(2'000'000'000);
  histogram.record(9'000'000'000);

  const HistogramBuckets buckets = histogram.buckets();

  EXPECT_EQ(HistogramBuckets::bound_ns(0), 1024U);
  EXPECT_EQ(buckets.below.front(), 2U);
  EXPECT_EQ(buckets.below[1], 3U);
  EXPECT_EQ(buckets.below[buckets.below.size() - 2], 3U);
  EXPECT_EQ(buckets.below.back(), 4U);
  EXPECT_EQ(buckets.count, 5U);
  EXPECT_EQ(buckets.sum_ns, 11'000'002'047.0);
}

static_assert(sizeof(CoarseHistogram) <= 960, "there are two for each subscription");

}  // namespace
}  // namespace fastcycle::base

#include "measure/statistics.h"

#include <numeric>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace fastcycle::measure {
namespace {

std::vector<std::int64_t> microseconds_from_1_to(std::int64_t last) {
  std::vector<std::int64_t> values(static_cast<std::size_t>(last));
  std::iota(values.begin(), values.end(), 1);
  for (std::int64_t& value : values) {
    value *= 1000;
  }
  return values;
}

TEST(Statistics, PercentilesAreTheNearestRank) {
  const Statistics result = summarize(microseconds_from_1_to(1000));

  EXPECT_EQ(result.count, 1000U);
  EXPECT_DOUBLE_EQ(result.min_us, 1);
  EXPECT_DOUBLE_EQ(result.p50_us, 500);
  EXPECT_DOUBLE_EQ(result.p90_us, 900);
  EXPECT_DOUBLE_EQ(result.p99_us, 990);
  EXPECT_DOUBLE_EQ(result.p999_us, 999);
  EXPECT_DOUBLE_EQ(result.max_us, 1000);
}

TEST(Statistics, PercentilesOfFewValuesAreValuesThatOccurred) {
  const Statistics result = summarize({3000, 1000, 2000});

  EXPECT_DOUBLE_EQ(result.p50_us, 2);
  EXPECT_DOUBLE_EQ(result.p90_us, 3);
  EXPECT_DOUBLE_EQ(result.p999_us, 3);
}

TEST(Statistics, DeviationIsThatOfThePopulation) {
  const Statistics result = summarize({2000, 4000, 4000, 4000, 5000, 5000, 7000, 9000});

  EXPECT_DOUBLE_EQ(result.mean_us, 5);
  EXPECT_DOUBLE_EQ(result.std_us, 2);
}

TEST(Statistics, OneFarValueIsNotLeftOut) {
  auto values = microseconds_from_1_to(100);
  values.push_back(1'000'000'000);

  const Statistics result = summarize(values);

  EXPECT_DOUBLE_EQ(result.max_us, 1e6);
  EXPECT_GT(result.mean_us, 9000);
}

TEST(Statistics, OfNothingAreZero) {
  const Statistics result = summarize({});

  EXPECT_EQ(result.count, 0U);
  EXPECT_DOUBLE_EQ(result.max_us, 0);
  EXPECT_DOUBLE_EQ(result.std_us, 0);
}

TEST(Histogram, CountsEveryValueOnceAtItsUpperBound) {
  const auto values = microseconds_from_1_to(300);

  const auto histogram = nlohmann::json::parse(histogram_json(values));

  std::size_t sum = 0;
  std::size_t up_to_64 = 0;
  for (const auto& [bound, count] : histogram.items()) {
    sum += count.get<std::size_t>();
    up_to_64 += std::stod(bound) <= 64.0 ? count.get<std::size_t>() : 0;
  }
  EXPECT_EQ(sum, values.size());
  EXPECT_EQ(up_to_64, 64U);
}

TEST(Histogram, OfNothingIsEmpty) {
  EXPECT_EQ(histogram_json({}), "{}");
}

}  // namespace
}  // namespace fastcycle::measure

// Predictions against what road users did then, with their current states as known exactly.

#include "evaluation.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace ads {
namespace {

void expect_better_than_constant_velocity(const PredictionScores& scores, std::size_t count_min) {
  fmt::print("{}", scores.table());
  for (const auto& [name, kind] : scores.by_kind()) {
    for (std::size_t ahead = 0; ahead < kind.size(); ++ahead) {
      const auto& one = kind[ahead];
      if (one.most_probable_m.size() < count_min) {
        continue;
      }
      const auto words = fmt::format("{}, {} s", name, PredictionScores::kAhead_s[ahead]);
      // Recorded cars are noisy: within the first second nothing is closer than straight on.
      const double most = PredictionScores::kAhead_s[ahead] == 1 ? 1.05 : 1.01;
      EXPECT_LE(mean_of(one.most_probable_m), most * mean_of(one.constant_velocity_m)) << words;
      EXPECT_LE(quantile_of(one.most_probable_m, 0.5),
                most * quantile_of(one.constant_velocity_m, 0.5))
          << words;
      const auto all = static_cast<double>(one.most_probable_m.size());
      EXPECT_GT(static_cast<double>(one.within_along) / all, 0.8) << words;
      EXPECT_GT(static_cast<double>(one.within_across) / all, 0.8) << words;
    }
  }
}

TEST(ManyPredictions, OfRecordedCarsAreCloserThanConstantVelocity) {
  PredictionScores scores;
  scores.add(
      Scenario::read(std::filesystem::path(ADS_DIR) / "data/commonroad/USA_US101-23_1_T-1.xml"),
      {});

  ASSERT_GT(scores.by_kind().at("all")[3].most_probable_m.size(), 300U);
  expect_better_than_constant_velocity(scores, 300);
}

TEST(ManyPredictions, OnRoadsOfManyKindsAreCloserThanConstantVelocity) {
  const char* const data = std::getenv("FASTCYCLE_DATA");
  const auto folder =
      std::filesystem::path(data == nullptr ? "/nowhere" : data) / "commonroad_more";
  if (!std::filesystem::is_directory(folder)) {
    GTEST_SKIP() << "no " << folder << "; FASTCYCLE_DATA names the folder of recorded data";
  }
  PredictionScores scores;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".xml") {
      scores.add(Scenario::read(entry.path()), {});
    }
  }
  expect_better_than_constant_velocity(scores, 300);
}

}  // namespace
}  // namespace ads

#include "config/nearest.h"

#include <gtest/gtest.h>

namespace fastcycle::config {
namespace {

TEST(Nearest, DistanceCountsEachKindOfSlipOnce) {
  EXPECT_EQ(edit_distance("depth", "depth"), 0U);
  EXPECT_EQ(edit_distance("dept", "depth"), 1U);
  EXPECT_EQ(edit_distance("deepth", "depth"), 1U);
  EXPECT_EQ(edit_distance("debth", "depth"), 1U);
  EXPECT_EQ(edit_distance("detph", "depth"), 1U);
  EXPECT_EQ(edit_distance("", "depth"), 5U);
}

TEST(Nearest, ADistanceAboveTheLimitIsAboveIt) {
  EXPECT_EQ(edit_distance("detph", "depth", 1), 1U);
  EXPECT_EQ(edit_distance("speed_limiter", "steering", 20),
            edit_distance("speed_limiter", "steering"));
  EXPECT_GT(edit_distance("speed_limiter", "steering", 2), 2U);
  EXPECT_GT(edit_distance("", "depth", 2), 2U);
}

TEST(Nearest, FindsTheNameThatIsMeant) {
  const std::vector<std::string> known = {"params", "library", "executor"};

  EXPECT_EQ(nearest("parms", known), "params");
  EXPECT_EQ(nearest("libary", known), "library");
  EXPECT_EQ(nearest("execturo", known), "executor");
}

TEST(Nearest, KeepsSilentWhenNothingIsNear) {
  EXPECT_EQ(nearest("colour", {"params", "library"}), "");
  EXPECT_EQ(nearest("", {"a"}), "");
  EXPECT_EQ(nearest("a", {}), "");
  EXPECT_EQ(nearest(std::string(100, 'a'), {std::string(99, 'a')}), "");
}

TEST(Nearest, TakesTheNearestOfSeveral) {
  EXPECT_EQ(nearest("limit_mps", {"limit_mps2", "limits_mps2", "limit"}), "limit_mps2");
}

}  // namespace
}  // namespace fastcycle::config

#include "base/pattern.h"

#include <string>

#include <gtest/gtest.h>

namespace fastcycle::base {
namespace {

TEST(Pattern, APatternWithoutStarsMeansOneName) {
  EXPECT_TRUE(matches("control/speed", "control/speed"));
  EXPECT_FALSE(matches("control/speed", "control/speeds"));
  EXPECT_FALSE(matches("control/speed", "control"));
  EXPECT_FALSE(matches("control", "control/speed"));
}

TEST(Pattern, AStarStaysWithinItsLevel) {
  EXPECT_TRUE(matches("control/*", "control/speed"));
  EXPECT_FALSE(matches("control/*", "control/speed/raw"));
  EXPECT_TRUE(matches("*/front*/im*ge", "camera/front_left/image"));
  EXPECT_FALSE(matches("*", "control/speed"));
  EXPECT_TRUE(matches("radar/?", "radar/1"));
  EXPECT_FALSE(matches("radar/?", "radar/12"));
}

TEST(Pattern, TwoStarsStandForAnyNumberOfLevels) {
  EXPECT_TRUE(matches("**", "control/speed"));
  EXPECT_TRUE(matches("camera/**", "camera/front/image"));
  EXPECT_TRUE(matches("camera/**", "camera"));
  EXPECT_TRUE(matches("**/status", "a/b/status"));
  EXPECT_TRUE(matches("**/status", "status"));
  EXPECT_FALSE(matches("**/status", "a/my_status"));
  EXPECT_TRUE(matches("a/**/b/**/c", "a/x/b/b/y/c"));
  EXPECT_FALSE(matches("a/**/b/**/c", "a/x/b/y"));
}

TEST(Pattern, ManyStarsDoNotTakeForEver) {
  std::string pattern;
  for (int i = 0; i < 200; ++i) {
    pattern += "*a";
  }
  EXPECT_FALSE(matches(pattern, std::string(5000, 'a') + "b"));
}

}  // namespace
}  // namespace fastcycle::base

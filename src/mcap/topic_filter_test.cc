#include "mcap/topic_filter.h"

#include <string>

#include <gtest/gtest.h>

namespace fastcycle::mcap {
namespace {

TEST(TopicFilter, APatternWithoutStarsMeansOneTopic) {
  EXPECT_TRUE(matches("control/speed", "control/speed"));
  EXPECT_FALSE(matches("control/speed", "control/speeds"));
  EXPECT_FALSE(matches("control/speed", "control"));
  EXPECT_FALSE(matches("control", "control/speed"));
}

TEST(TopicFilter, AStarStaysWithinItsLevel) {
  EXPECT_TRUE(matches("control/*", "control/speed"));
  EXPECT_FALSE(matches("control/*", "control/speed/raw"));
  EXPECT_TRUE(matches("*/front*/im*ge", "camera/front_left/image"));
  EXPECT_FALSE(matches("*", "control/speed"));
  EXPECT_TRUE(matches("radar/?", "radar/1"));
  EXPECT_FALSE(matches("radar/?", "radar/12"));
}

TEST(TopicFilter, TwoStarsStandForAnyNumberOfLevels) {
  EXPECT_TRUE(matches("**", "control/speed"));
  EXPECT_TRUE(matches("camera/**", "camera/front/image"));
  EXPECT_TRUE(matches("camera/**", "camera"));
  EXPECT_TRUE(matches("**/status", "a/b/status"));
  EXPECT_TRUE(matches("**/status", "status"));
  EXPECT_FALSE(matches("**/status", "a/my_status"));
  EXPECT_TRUE(matches("a/**/b/**/c", "a/x/b/b/y/c"));
  EXPECT_FALSE(matches("a/**/b/**/c", "a/x/b/y"));
}

TEST(TopicFilter, ManyStarsDoNotTakeForEver) {
  std::string pattern;
  for (int i = 0; i < 200; ++i) {
    pattern += "*a";
  }
  EXPECT_FALSE(matches(pattern, std::string(5000, 'a') + "b"));
}

TEST(TopicFilter, WhatIsExceptedIsNotWanted) {
  const TopicFilter filter{.topics = {"camera/**", "radar"}, .except = {"camera/*/raw"}};
  EXPECT_TRUE(filter.wants("camera/front/image"));
  EXPECT_FALSE(filter.wants("camera/front/raw"));
  EXPECT_FALSE(filter.wants("lidar"));
  EXPECT_TRUE(TopicFilter{}.wants("anything"));
}

}  // namespace
}  // namespace fastcycle::mcap

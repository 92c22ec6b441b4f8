#include "mcap/topic_filter.h"

#include <gtest/gtest.h>

namespace fastcycle::mcap {
namespace {

TEST(TopicFilter, WhatIsExceptedIsNotWanted) {
  const TopicFilter filter{.topics = {"camera/**", "radar"}, .except = {"camera/*/raw"}};
  EXPECT_TRUE(filter.wants("camera/front/image"));
  EXPECT_FALSE(filter.wants("camera/front/raw"));
  EXPECT_FALSE(filter.wants("lidar"));
  EXPECT_TRUE(TopicFilter{}.wants("anything"));
}

}  // namespace
}  // namespace fastcycle::mcap

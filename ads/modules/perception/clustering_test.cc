#include "clustering.h"

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr double kSpread_rad = 0.0035;

class ClusteringTest : public ::testing::Test {
 protected:
  const std::vector<int>& group(const std::vector<Eigen::Vector2f>& points) {
    return clustering_.group(points, kSpread_rad);
  }

  Clustering clustering_{ClusteringConfig{}};
};

TEST_F(ClusteringTest, NoPointsMakeNoGroups) {
  EXPECT_TRUE(group({}).empty());
  EXPECT_EQ(clustering_.groups(), 0);
}

TEST_F(ClusteringTest, ClosePointsAreOneGroupAndDistantOnesAreTwo) {
  EXPECT_EQ(group({{10.0F, 0.0F}, {10.0F, 0.2F}, {10.0F, 3.0F}, {10.0F, 0.4F}}),
            (std::vector<int>{0, 0, 1, 0}));
  EXPECT_EQ(clustering_.groups(), 2);
}

TEST_F(ClusteringTest, ChainIsOneGroup) {
  std::vector<Eigen::Vector2f> points;
  for (float y = -5.0F; y < 5.0F; y += 0.3F) {
    points.emplace_back(10.0F, y);
  }
  group(points);

  EXPECT_EQ(clustering_.groups(), 1);
}

TEST_F(ClusteringTest, AtADistanceMoreIsAllowedAlongTheLineOfSight) {
  group({{40.0F, 0.0F}, {41.3F, 0.0F}});
  EXPECT_EQ(clustering_.groups(), 1);

  group({{40.0F, 0.0F}, {40.0F, 1.3F}});
  EXPECT_EQ(clustering_.groups(), 2);

  group({{8.0F, 0.0F}, {9.3F, 0.0F}});
  EXPECT_EQ(clustering_.groups(), 2);
}

TEST_F(ClusteringTest, PointOutOfRangeIsInNoGroup) {
  EXPECT_EQ(group({{500.0F, 0.0F}, {10.0F, 0.0F}}), (std::vector<int>{-1, 0}));
}

TEST_F(ClusteringTest, EachCallBeginsAnew) {
  group({{10.0F, 0.0F}, {20.0F, 0.0F}});
  group({{15.0F, 0.0F}});

  EXPECT_EQ(clustering_.groups(), 1);
}

}  // namespace
}  // namespace ads

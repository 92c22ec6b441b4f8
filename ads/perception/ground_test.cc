#include "ground.h"

#include <cmath>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr double kMount_m = 1.8;

RawEcho echo_at(double x_m, double y_m, double z_m) {
  return {.x_m = static_cast<float>(x_m),
          .y_m = static_cast<float>(y_m),
          .z_m = static_cast<float>(z_m),
          .range_m = static_cast<float>(std::hypot(x_m, y_m))};
}

// Rings of ground that rises by `slope`, seen from above it.
std::vector<RawEcho> plane(double slope) {
  std::vector<RawEcho> echoes;
  for (double range = 4.0; range < 60.0; range *= 1.1) {
    for (double azimuth = -3.1; azimuth < 3.1; azimuth += 0.01) {
      echoes.push_back(echo_at(range * std::cos(azimuth), range * std::sin(azimuth),
                               -kMount_m + slope * range * std::cos(azimuth)));
    }
  }
  return echoes;
}

TEST(Ground, FlatGroundHasNoHeight) {
  Ground ground({});
  const auto echoes = plane(0.0);
  ground.fit(echoes, kMount_m);

  for (const RawEcho& echo : echoes) {
    ASSERT_NEAR(ground.height_m(echo), 0.0F, 0.01F);
  }
}

TEST(Ground, SlopeIsFollowed) {
  Ground ground({});
  const auto echoes = plane(0.03);
  ground.fit(echoes, kMount_m);

  for (const RawEcho& echo : echoes) {
    ASSERT_NEAR(ground.height_m(echo), 0.0F, 0.12F);
  }
}

TEST(Ground, WhatStandsOnItHasItsHeight) {
  Ground ground({});
  auto echoes = plane(0.0);
  for (double height = 0.1; height < 1.5; height += 0.1) {
    echoes.push_back(echo_at(20.0, 0.0, height - kMount_m));
  }
  ground.fit(echoes, kMount_m);

  EXPECT_NEAR(ground.height_m(echo_at(20.0, 0.0, 1.0 - kMount_m)), 1.0F, 0.11F);
}

TEST(Ground, WithoutEchoesItIsAsFarBelowAsTheSensorIsMounted) {
  Ground ground({});
  ground.fit({}, kMount_m);

  EXPECT_NEAR(ground.height_m(echo_at(30.0, 5.0, 0.0)), 1.8F, 1e-5F);
}

TEST(Ground, EchoesBeyondItsRangeCountToItsLastBin) {
  Ground ground({});
  ground.fit(plane(0.0), kMount_m);

  EXPECT_NEAR(ground.height_m(echo_at(500.0, 0.0, -1.0)), 0.8F, 0.01F);
}

}  // namespace
}  // namespace ads

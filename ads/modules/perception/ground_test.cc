#include "ground.h"

#include <cmath>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr double kMount_m = 1.8;

RawReturn return_at(double x_m, double y_m, double z_m) {
  return {.x_m = static_cast<float>(x_m),
          .y_m = static_cast<float>(y_m),
          .z_m = static_cast<float>(z_m),
          .range_m = static_cast<float>(std::hypot(x_m, y_m))};
}

// Rings of ground that rises by `slope`, seen from above it.
std::vector<RawReturn> plane(double slope) {
  std::vector<RawReturn> returns;
  for (double range = 4.0; range < 60.0; range *= 1.1) {
    for (double azimuth = -3.1; azimuth < 3.1; azimuth += 0.01) {
      returns.push_back(return_at(range * std::cos(azimuth), range * std::sin(azimuth),
                                  -kMount_m + slope * range * std::cos(azimuth)));
    }
  }
  return returns;
}

TEST(Ground, FlatGroundHasNoHeight) {
  Ground ground({});
  const auto returns = plane(0.0);
  ground.fit(returns, kMount_m);

  for (const RawReturn& beam_return : returns) {
    ASSERT_NEAR(ground.height_m(beam_return), 0.0F, 0.01F);
  }
}

TEST(Ground, SlopeIsFollowed) {
  Ground ground({});
  const auto returns = plane(0.03);
  ground.fit(returns, kMount_m);

  for (const RawReturn& beam_return : returns) {
    ASSERT_NEAR(ground.height_m(beam_return), 0.0F, 0.12F);
  }
}

TEST(Ground, WhatStandsOnItHasItsHeight) {
  Ground ground({});
  auto returns = plane(0.0);
  for (double height = 0.1; height < 1.5; height += 0.1) {
    returns.push_back(return_at(20.0, 0.0, height - kMount_m));
  }
  ground.fit(returns, kMount_m);

  EXPECT_NEAR(ground.height_m(return_at(20.0, 0.0, 1.0 - kMount_m)), 1.0F, 0.11F);
}

TEST(Ground, WithoutReturnsItIsAsFarBelowAsTheSensorIsMounted) {
  Ground ground({});
  ground.fit({}, kMount_m);

  EXPECT_NEAR(ground.height_m(return_at(30.0, 5.0, 0.0)), 1.8F, 1e-5F);
}

TEST(Ground, ReturnsBeyondItsRangeCountToItsLastBin) {
  Ground ground({});
  ground.fit(plane(0.0), kMount_m);

  EXPECT_NEAR(ground.height_m(return_at(500.0, 0.0, -1.0)), 0.8F, 0.01F);
}

}  // namespace
}  // namespace ads

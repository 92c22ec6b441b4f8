#include "reference.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace rav4 {
namespace {

using std::chrono_literals::operator""ms;

TEST(Reference, PositionBetweenFramesIsOnTheStraightLine) {
  const Reference reference(
      {{.offset = 0ms, .ecef_m = {0.0, 0.0, 0.0}}, {.offset = 50ms, .ecef_m = {1.0, 0.0, 2.0}}});

  EXPECT_DOUBLE_EQ(reference.ecef_at(25ms)->x(), 0.5);
  EXPECT_DOUBLE_EQ(reference.ecef_at(25ms)->z(), 1.0);
  EXPECT_EQ(reference.ecef_at(50ms)->x(), 1.0);
  EXPECT_EQ(reference.ecef_at(0ms)->x(), 0.0);
}

TEST(Reference, OutsideOfTheFramesThereIsNone) {
  const Reference reference({{.offset = 0ms, .ecef_m = {}}, {.offset = 50ms, .ecef_m = {}}});

  EXPECT_FALSE(reference.ecef_at(-1ms));
  EXPECT_FALSE(reference.ecef_at(51ms));
  EXPECT_FALSE(Reference({}).ecef_at(0ms));
}

TEST(Reference, TimesThatDoNotGrowAreRefused) {
  EXPECT_THROW(Reference({{.offset = 50ms, .ecef_m = {}}, {.offset = 50ms, .ecef_m = {}}}),
               std::runtime_error);
}

}  // namespace
}  // namespace rav4
